#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "gpu/device/gpu_buffer.h"
#include "gpu/device/gpu_device.h"

namespace hpr {

/// A buffer in the device's own memory that holds `bytes`; the copy is done. Throws Error (Limit) where the device has
/// not so much memory left.
[[nodiscard]] GpuBuffer upload(const GpuDevice& device, std::span<const std::byte> bytes);

template <typename T, std::size_t kCount>
[[nodiscard]] GpuBuffer upload(const GpuDevice& device, std::span<T, kCount> values) {
  return upload(device, std::span<const std::byte>(std::as_bytes(values)));
}

/// Arrays in a device's memory that the CPU made and shaders read. The device must outlive it.
class GpuTables {
 public:
  explicit GpuTables(const GpuDevice& device) : device_(device) {}

  /// Returns the address; 0 for an empty array. Throws Error (Limit) where the device has not so much memory left.
  template <typename T, std::size_t kCount>
  std::uint64_t upload(std::span<T, kCount> values) {
    return values.empty() ? 0 : buffers_.emplace_back(hpr::upload(device_, values)).address();
  }
  template <typename T>
  std::uint64_t upload(const std::vector<T>& values) {
    return upload(std::span<const T>(values));
  }
  template <typename T>
  std::uint64_t upload_one(const T& value) {
    return upload(std::span<const T>(&value, 1));
  }

 private:
  const GpuDevice& device_;
  std::vector<GpuBuffer> buffers_;
};

}  // namespace hpr
