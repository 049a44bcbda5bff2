#include "gpu/device/gpu_tables.h"

#include <algorithm>

#include "gpu/device/gpu_batch.h"

namespace hpr {

std::uint64_t GpuTables::upload_bytes(std::span<const std::byte> bytes) {
  if (bytes.empty()) return 0;
  const GpuBuffer& there = buffers_.emplace_back(device_, bytes.size(), GpuMemory::Device);
  const GpuBuffer staging(device_, bytes.size(), GpuMemory::Upload);
  std::ranges::copy(bytes, staging.mapped().begin());
  GpuBatch batch(device_);
  batch.copy(staging, there, bytes.size());
  batch.submit();
  batch.wait();
  return there.address();
}

}  // namespace hpr
