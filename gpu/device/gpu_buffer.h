#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "gpu/device/gpu_device.h"

namespace hpr {

/// Where the bytes of a buffer are.
enum class GpuMemory {
  Device,    ///< only kernels and copies reach them
  Upload,    ///< the CPU writes them, a device reads them
  Readback,  ///< a device writes them, the CPU reads them
};

/// Bytes that kernels reach by address. The device must outlive it; so must work that uses it be waited for.
class GpuBuffer {
 public:
  /// Throws Error (Limit) where the device has not so much memory left.
  GpuBuffer(const GpuDevice& device, std::size_t bytes, GpuMemory memory);
  ~GpuBuffer();
  GpuBuffer(GpuBuffer&& other) noexcept;
  GpuBuffer& operator=(GpuBuffer&&) = delete;
  GpuBuffer(const GpuBuffer&) = delete;
  GpuBuffer& operator=(const GpuBuffer&) = delete;

  [[nodiscard]] std::size_t bytes() const { return bytes_; }
  [[nodiscard]] VkBuffer handle() const { return buffer_; }
  /// As shaders' references take it.
  [[nodiscard]] std::uint64_t address() const { return address_; }
  /// The bytes as the CPU sees them; empty for GpuMemory::Device.
  template <typename T = std::byte>
  [[nodiscard]] std::span<T> mapped() const {
    static_assert(std::is_trivially_copyable_v<T>);
    return {static_cast<T*>(mapped_), mapped_ == nullptr ? 0 : bytes_ / sizeof(T)};
  }

 private:
  const GpuDevice* device_;
  std::size_t bytes_;
  VkBuffer buffer_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  std::uint64_t address_ = 0;
  void* mapped_ = nullptr;

  void release();
};

}  // namespace hpr
