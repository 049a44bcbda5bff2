#pragma once

#include <cstddef>
#include <span>

#include "gpu/gpu_buffer.h"
#include "gpu/gpu_device.h"

namespace hpr {

/// A buffer in the device's own memory that holds `bytes`; the copy is done. Throws Error (Limit) where the device has
/// not so much memory left.
[[nodiscard]] GpuBuffer upload(const GpuDevice& device, std::span<const std::byte> bytes);

template <typename T, std::size_t kCount>
[[nodiscard]] GpuBuffer upload(const GpuDevice& device, std::span<T, kCount> values) {
  return upload(device, std::span<const std::byte>(std::as_bytes(values)));
}

}  // namespace hpr
