#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "gpu/device/vulkan_functions.h"

namespace hpr {

/// A device that Vulkan knows.
struct GpuInfo {
  int index = 0;                        ///< in Vulkan's order, from 0
  std::string name;                     ///< "NVIDIA H100 80GB HBM3"
  std::string driver;                   ///< "Mesa 22.3.6 (LLVM 15.0.6)"
  bool software = false;                ///< the CPU does its work
  bool discrete = false;                ///< a card of its own
  std::uint64_t memory = 0;             ///< bytes of the largest heap of its own
  std::array<std::uint8_t, 16> uuid{};  ///< equal: one GPU, by two drivers
  std::string lacks;                    ///< what hpr's kernels need and it has not; empty: nothing
};

/// All devices of this machine. Throws Error (NoDevice) where there is no Vulkan, or one before 1.2.
[[nodiscard]] std::vector<GpuInfo> find_gpus();

struct GpuOptions {
  int device = -1;        ///< GpuInfo::index; -1: GPUs are dealt out by local rank
  int local_rank = 0;     ///< of this process on its host
  bool software = false;  ///< where no GPU is, a device that runs on the CPU will do
  /// Vulkan's validation layer looks at every call; what it finds is logged as errors and counted.
  bool validate = false;
  /// Work that is not done after so long counts as lost.
  std::chrono::seconds limit{30};
};

/// The device that these options choose: cards before GPUs that share the CPU's memory. Throws Error: NoDevice where
/// there is none that can do hpr's work; Usage for an index there is not.
[[nodiscard]] GpuInfo choose_gpu(const std::vector<GpuInfo>& gpus, const GpuOptions& options);

class GpuKernel;

/// A device with one queue for all that is done on it. It outlives its buffers, kernels and batches; one thread uses
/// it at a time.
class GpuDevice {
 public:
  /// Throws Error: NoDevice without a device as asked for, with what was found; Usage for an index there is not.
  explicit GpuDevice(const GpuOptions& options);
  /// Chooses one of all devices of the machine; throws Error for none.
  using Choose = std::function<GpuInfo(const std::vector<GpuInfo>&)>;
  /// Starts the device that `choose` returns, in place of choose_gpu(). What that throws goes on; Error (NoDevice)
  /// where the device does not start.
  GpuDevice(const GpuOptions& options, const Choose& choose);
  ~GpuDevice();
  GpuDevice(const GpuDevice&) = delete;
  GpuDevice& operator=(const GpuDevice&) = delete;

  [[nodiscard]] const GpuInfo& info() const { return info_; }
  /// How much the validation layer has found so far, warnings too; counts on while the device ends. 0 without it.
  [[nodiscard]] std::shared_ptr<const std::atomic<std::uint64_t>> validation_errors() const;
  /// Whether the validation layer was asked for and is there.
  [[nodiscard]] bool validates() const;

  [[nodiscard]] const VulkanFunctions& vk() const { return *vk_; }
  [[nodiscard]] VkDevice handle() const { return device_; }
  [[nodiscard]] VkQueue queue() const { return queue_; }
  [[nodiscard]] std::uint32_t queue_family() const { return queue_family_; }
  [[nodiscard]] double timestamp_ns() const { return timestamp_ns_; }             ///< of one tick; 0: it has no clock
  [[nodiscard]] std::uint64_t timestamp_mask() const { return timestamp_mask_; }  ///< of the bits that count
  [[nodiscard]] std::chrono::seconds limit() const { return limit_; }

  /// As GpuKernel's constructor makes it of a shader that stays where it is; made once, and kept as long as the device:
  /// whoever lights by other settings need not wait for it again.
  [[nodiscard]] const GpuKernel& kernel(std::span<const std::uint32_t> spirv, std::size_t constants,
                                        std::uint32_t variant = 0) const;

  /// The first memory type of those in `types` that has all of `wanted`; -1: none.
  [[nodiscard]] int memory_type(std::uint32_t types, VkMemoryPropertyFlags wanted) const;

  /// Of the heap that such memory comes from.
  [[nodiscard]] std::uint64_t heap_bytes(int memory_type) const;

  /// Work on it has not ended in time: what it may still use stays for ever, and so do its buffers, kernels and
  /// batches.
  void give_up() const { given_up_ = true; }
  [[nodiscard]] bool is_given_up() const { return given_up_; }

  /// Throws Error unless `result` is a success: NoDevice for a device that was lost, Limit for memory that is used up,
  /// else Internal. `doing`: "allocating 4.0 GiB". `limits`: how many times limit() was waited for.
  void check(VkResult result, std::string_view doing, int limits = 1) const;

 private:
  struct Instance;
  friend std::vector<GpuInfo> find_gpus();

  std::unique_ptr<Instance> instance_;
  const VulkanFunctions* vk_ = nullptr;
  std::unique_ptr<VulkanFunctions> functions_;
  GpuInfo info_;
  VkDevice device_ = VK_NULL_HANDLE;
  VkQueue queue_ = VK_NULL_HANDLE;
  std::uint32_t queue_family_ = 0;
  double timestamp_ns_ = 0.0;
  std::uint64_t timestamp_mask_ = 0;
  std::chrono::seconds limit_;
  VkPhysicalDeviceMemoryProperties memory_{};
  mutable bool given_up_ = false;
  mutable std::map<std::pair<const std::uint32_t*, std::uint32_t>, std::unique_ptr<const GpuKernel>> kernels_;
};

}  // namespace hpr
