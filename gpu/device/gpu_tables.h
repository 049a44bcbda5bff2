#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "gpu/device/gpu_buffer.h"
#include "gpu/device/gpu_device.h"

namespace hpr {

/// Arrays in a device's memory that the CPU made and shaders read. The device must outlive it.
class GpuTables {
 public:
  explicit GpuTables(const GpuDevice& device) : device_(device) {}

  /// Returns the address, once the copy is done; 0 for an empty array. Throws Error (Limit) where the device has not so
  /// much memory left.
  template <typename T, std::size_t kCount>
  std::uint64_t upload(std::span<T, kCount> values) {
    static_assert(std::is_trivially_copyable_v<T>);
    return upload_bytes(std::as_bytes(values));
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
  std::uint64_t upload_bytes(std::span<const std::byte> bytes);

  const GpuDevice& device_;
  std::vector<GpuBuffer> buffers_;
};

}  // namespace hpr
