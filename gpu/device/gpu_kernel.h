#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "gpu/device/gpu_device.h"

namespace hpr {

/// Threads of a workgroup of every kernel, side by side: a multiple of 8, as software devices hang on others.
inline constexpr std::uint32_t kGroupThreads = 64;
/// Bytes of constants that every device takes with a kernel.
inline constexpr std::size_t kMaxKernelConstants = 128;

/// A shader of gpu/shaders, ready to run. The device must outlive it.
class GpuKernel {
 public:
  /// `spirv`: the words of the compiled shader. `constants`: bytes of its push constants. `variant`: the value of its
  /// specialization constant 0, where it has one: what that leaves out is never compiled.
  GpuKernel(const GpuDevice& device, std::span<const std::uint32_t> spirv, std::size_t constants,
            std::uint32_t variant = 0);
  ~GpuKernel();
  GpuKernel(const GpuKernel&) = delete;
  GpuKernel& operator=(const GpuKernel&) = delete;

  [[nodiscard]] VkPipeline pipeline() const { return pipeline_; }
  [[nodiscard]] VkPipelineLayout layout() const { return layout_; }
  [[nodiscard]] std::size_t constants() const { return constants_; }

 private:
  const GpuDevice& device_;
  std::size_t constants_;
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  VkPipeline pipeline_ = VK_NULL_HANDLE;
};

/// Bytes from one element to the next of the array that a shader's buffer has of structures of this name: what the
/// buffer is to be made of, where the CPU does not look into it.
[[nodiscard]] std::size_t array_stride(std::span<const std::uint32_t> spirv, std::string_view structure);

}  // namespace hpr
