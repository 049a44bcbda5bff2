#include "gpu/gpu_tables.h"

#include <cstring>

#include "gpu/gpu_batch.h"

namespace hpr {

std::uint64_t GpuTables::upload_bytes(std::span<const std::byte> bytes) {
  if (bytes.empty()) return 0;
  const GpuBuffer staging(device_, bytes.size(), GpuMemory::Upload);
  std::memcpy(staging.mapped().data(), bytes.data(), bytes.size());
  const GpuBuffer& there = buffers_.emplace_back(device_, bytes.size(), GpuMemory::Device);
  GpuBatch batch(device_);
  batch.copy(staging, there, bytes.size());
  batch.submit();
  batch.wait();
  return there.address();
}

}  // namespace hpr
