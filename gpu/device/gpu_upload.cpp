#include "gpu/device/gpu_upload.h"

#include <algorithm>

#include "gpu/device/gpu_batch.h"

namespace hpr {

GpuBuffer upload(const GpuDevice& device, std::span<const std::byte> bytes) {
  GpuBuffer buffer(device, bytes.size(), GpuMemory::Device);
  if (bytes.empty()) return buffer;
  const GpuBuffer staging(device, bytes.size(), GpuMemory::Upload);
  std::ranges::copy(bytes, staging.mapped().begin());
  GpuBatch batch(device);
  batch.copy(staging, buffer, bytes.size());
  batch.submit();
  batch.wait();
  return buffer;
}

}  // namespace hpr
