#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <vector>

#include "gpu/gpu_batch.h"
#include "gpu/gpu_buffer.h"

namespace hpr {

/// Puts arrays on a device, each in a buffer of its own.
class GpuUploads {
 public:
  /// Buffers are appended to `buffers`. Both must outlive it.
  GpuUploads(const GpuDevice& device, std::vector<GpuBuffer>& buffers)
      : device_(device), buffers_(buffers), batch_(device) {}

  /// Returns the address; 0 for none. Throws Error (Limit) where the device's memory ends.
  template <typename T>
  std::uint64_t put(std::span<const T> values) {
    if (values.empty()) return 0;
    const auto bytes = std::as_bytes(values);
    staging_.emplace(device_, bytes.size(), GpuMemory::Upload);
    std::memcpy(staging_->mapped().data(), bytes.data(), bytes.size());
    const GpuBuffer& there = buffers_.emplace_back(device_, bytes.size(), GpuMemory::Device);
    batch_.copy(*staging_, there, bytes.size());
    batch_.submit();
    batch_.wait();
    staging_.reset();
    return there.address();
  }
  template <typename T>
  std::uint64_t put(const std::vector<T>& values) {
    return put(std::span<const T>(values));
  }
  template <typename T>
  std::uint64_t put_one(const T& value) {
    return put(std::span<const T>(&value, 1));
  }

 private:
  const GpuDevice& device_;
  std::vector<GpuBuffer>& buffers_;
  std::optional<GpuBuffer> staging_;  ///< before the batch, which may still read it when it ends
  GpuBatch batch_;
};

}  // namespace hpr
