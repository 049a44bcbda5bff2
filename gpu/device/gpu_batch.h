#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "gpu/device/gpu_buffer.h"
#include "gpu/device/gpu_device.h"
#include "gpu/device/gpu_kernel.h"

namespace hpr {

/// How long the device was at one pass of a batch.
struct GpuPassTime {
  std::string pass;
  double ms = 0.0;
};

/// Work for a device: recorded, submitted, waited for, again and again. What is recorded later sees all that was
/// written before. Buffers and kernels must outlive the wait, and the device all of them.
class GpuBatch {
 public:
  explicit GpuBatch(const GpuDevice& device);
  /// Waits for what was submitted, unless that was in vain before. Gives the device up where it does not end.
  ~GpuBatch();
  GpuBatch(const GpuBatch&) = delete;
  GpuBatch& operator=(const GpuBatch&) = delete;

  /// What is recorded from here on is timed together, up to the next pass; at most kMaxPasses of a batch are.
  void begin_pass(std::string name);
  static constexpr std::size_t kMaxPasses = 64;

  /// Runs a kernel for threads 0 to `threads` - 1, rounded up to whole groups: shaders find theirs by thread_index()
  /// and leave out the rest.
  template <typename Constants>
  void run(const GpuKernel& kernel, std::uint64_t threads, const Constants& constants) {
    static_assert(std::is_trivially_copyable_v<Constants>);
    run(kernel, threads, std::as_bytes(std::span(&constants, 1)));
  }
  /// Has a software device compile a kernel, as it does when that runs first. That takes seconds, of large ones many:
  /// waits for up to four of the device's limits. `constants`: by which the one thread does nothing.
  template <typename Constants>
  void compile(const GpuKernel& kernel, const Constants& constants) {
    run(kernel, 1, constants);
    submit();
    wait(4);
  }
  /// Bytes from the start of one buffer to that of the other.
  void copy(const GpuBuffer& from, const GpuBuffer& to, std::size_t bytes);
  /// Sets every four bytes of a buffer; its size is a multiple of four.
  void fill(const GpuBuffer& buffer, std::uint32_t word);

  /// Sends what was recorded on its way.
  void submit();
  /// Until it is done. Throws Error: Hang past so many of the device's limits, after which it may be waited for again;
  /// NoDevice where the device was lost.
  void wait(int limits = 1);
  /// Of the last batch that was waited for; empty where it had no passes or the device
  /// has no clock.
  [[nodiscard]] const std::vector<GpuPassTime>& times() const { return times_; }

 private:
  void run(const GpuKernel& kernel, std::uint64_t threads, std::span<const std::byte> constants);
  void begin();
  /// What comes next sees what was written so far.
  void order();
  void stamp();
  void read_times();
  void trace_times() const;

  const GpuDevice& device_;
  VkCommandPool pool_ = VK_NULL_HANDLE;
  VkCommandBuffer commands_ = VK_NULL_HANDLE;
  VkSemaphore semaphore_ = VK_NULL_HANDLE;
  VkQueryPool stamps_ = VK_NULL_HANDLE;
  std::uint64_t submitted_ = 0;    ///< the semaphore's value once all is done
  std::int64_t submitted_ns_ = 0;  ///< of the clock that traces are timed by
  bool recording_ = false;
  bool in_flight_ = false;
  bool is_late_ = false;  ///< was waited for in vain
  std::vector<std::string> passes_;
  std::vector<GpuPassTime> times_;

  void release();
};

}  // namespace hpr
