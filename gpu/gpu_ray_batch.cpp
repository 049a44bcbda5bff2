#include "gpu/gpu_ray_batch.h"

#include <hpr/shaders/ray_rates.h>

#include <algorithm>
#include <numeric>

#include "core/timing.h"

namespace hpr {
namespace {

/// Traced at once: what waits have a limit for is never all.
constexpr std::size_t kSoftwareRays = std::size_t{1} << 16U;
constexpr std::size_t kRays = std::size_t{1} << 22U;

struct Constants {
  std::uint64_t rays;
  std::uint64_t answers;
  std::uint64_t scene;
  std::uint32_t count;
  std::uint32_t any;
};
static_assert(sizeof(GpuRay) == 56);  // shaders read them as they are

GpuTime run(GpuBatch& batch) {
  const Stopwatch watch;
  batch.submit();
  batch.wait();
  GpuTime time{.clock_ms = watch.ms()};
  for (const GpuPassTime& pass : batch.times()) time.device_ms += pass.ms;
  return time;
}

}  // namespace

GpuTime& GpuTime::operator+=(const GpuTime& other) {
  device_ms += other.device_ms;
  clock_ms += other.clock_ms;
  return *this;
}

GpuRayBatch::GpuRayBatch(const GpuDevice& device, const GpuScene& scene, std::span<const GpuRay> rays)
    : device_(device),
      scene_(scene),
      count_(rays.size()),
      kernel_(device.kernel(ray_rates, sizeof(Constants))),
      rays_(device, std::max<std::size_t>(rays.size_bytes(), 1), GpuMemory::Device),
      answers_(device, std::max<std::size_t>(rays.size(), 1) * sizeof(std::uint32_t), GpuMemory::Device),
      batch_(device) {
  const GpuBuffer ready(device, rays_.bytes(), GpuMemory::Upload);
  std::ranges::copy(rays, ready.mapped<GpuRay>().begin());
  batch_.copy(ready, rays_, rays.size_bytes());
  batch_.submit();
  batch_.wait();
}

GpuTime GpuRayBatch::trace(Query query) {
  const std::size_t most = device_.info().software ? kSoftwareRays : kRays;
  GpuTime time;
  for (std::size_t first = 0; first < count_; first += most) {
    const std::size_t count = std::min(most, count_ - first);
    batch_.begin_pass("rays");
    batch_.run(kernel_, count,
               Constants{rays_.address() + first * sizeof(GpuRay), answers_.address() + first * sizeof(std::uint32_t),
                         scene_.address(), static_cast<std::uint32_t>(count), query == Query::AnyHit ? 1U : 0U});
    time += run(batch_);
  }
  return time;
}

std::uint64_t GpuRayBatch::count_hits() {
  const GpuBuffer read(device_, answers_.bytes(), GpuMemory::Readback);
  batch_.copy(answers_, read, count_ * sizeof(std::uint32_t));
  batch_.submit();
  batch_.wait();
  const auto answers = read.mapped<const std::uint32_t>().first(count_);
  return std::accumulate(answers.begin(), answers.end(), std::uint64_t{0});
}

GpuTime measure_read_back(const GpuDevice& device, std::size_t bytes) {
  const GpuBuffer there(device, bytes, GpuMemory::Device);
  const GpuBuffer here(device, bytes, GpuMemory::Readback);
  GpuBatch batch(device);
  batch.fill(there, 1);
  batch.copy(there, here, bytes);  // pages are here before what counts
  batch.submit();
  batch.wait();
  batch.begin_pass("read back");
  batch.copy(there, here, bytes);
  return run(batch);
}

}  // namespace hpr
