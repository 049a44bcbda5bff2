#include "tools/bench/bench_device.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <limits>

#include "core/error.h"
#include "engine/session.h"
#include "gpu/gpu_keys.h"
#include "gpu/gpu_scene.h"
#include "tools/sweep.h"

namespace hpr {
namespace {

constexpr int kTries = 5;
constexpr int kKeyFrames = 5;
constexpr double kOtherHits = 1e-3;  // rays through edges

/// The quickest of some tries, by either clock.
template <typename Measure>
GpuTime best_of(const Measure& measure) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  GpuTime best{kInfinity, kInfinity};
  for (int i = 0; i < kTries; ++i) {
    const GpuTime time = measure();
    best = {std::min(best.device_ms, time.device_ms), std::min(best.clock_ms, time.clock_ms)};
  }
  return best;
}

BenchRow speed_row(std::string name, double ours, double floor, std::string unit) {
  return {std::move(name), ours, floor, std::move(unit), floor > 0.0 ? ours / floor : 0.0};
}

/// `work` done in a time, by the device's clock where it has one, and by the CPU's.
void add_speeds(std::vector<BenchRow>& rows, const std::string& name, double work, const GpuTime& time, double floor,
                const std::string& unit) {
  rows.push_back(speed_row(name, work / time.ms(), floor, unit));
  if (time.device_ms > 0.0) rows.push_back(speed_row(name + ", by the clock", work / time.clock_ms, floor, unit));
}

void check_hits(const DeviceRays& set, std::uint64_t hits) {
  const std::uint64_t others = std::max(hits, set.embree_hits) - std::min(hits, set.embree_hits);
  if (static_cast<double>(others) <= kOtherHits * static_cast<double>(set.rays.size()) + 1.0) return;
  throw Error(ExitCode::CheckFailed, fmt::format("{} rays: {} met something on the device, but {} in Embree", set.name,
                                                 hits, set.embree_hits));
}

}  // namespace

bool measures_device(const Globals& globals) {
  return globals.backend == kVulkan;
}

GlOptions gl_options(const Globals& globals, int threads) {
  if (measures_device(globals)) return {.threads = threads};
  return {.backend = globals.backend, .device = globals.device, .local_rank = 0, .threads = threads};
}

std::unique_ptr<GpuDevice> device_of(const Globals& globals) {
  return std::make_unique<GpuDevice>(GpuOptions{.device = globals.device, .software = true});
}

std::vector<BenchRow> bench_device_rays(const GpuDevice& device, const Scene& scene, std::span<const DeviceRays> sets) {
  const GpuScene there(device, scene, std::array{SurfaceRange{0, scene.triangles}}, 1);
  std::vector<BenchRow> rows;
  for (const DeviceRays& set : sets) {
    if (set.rays.empty()) continue;
    GpuRayBatch batch(device, there, set.rays);
    (void)batch.trace(set.query);  // kernels are compiled
    check_hits(set, batch.count_hits());
    const double work = static_cast<double>(set.rays.size()) * 1e-6;  // a million per ms is a thousand million a second
    add_speeds(rows, fmt::format("device {}", set.name), work, best_of([&] { return batch.trace(set.query); }),
               work / set.embree_ms, "G/s");
  }
  return rows;
}

std::vector<BenchRow> bench_read_back(const GpuDevice& device) {
  constexpr std::size_t kBytes = std::size_t{64} << 20U;
  const std::vector<std::byte> from(kBytes, std::byte{1});
  std::vector<std::byte> into(kBytes);
  const double copy = median_times({[&] { std::memcpy(into.data(), from.data(), kBytes); }}, {1, kTries}).front();
  const double work = static_cast<double>(kBytes) * 1e-6;  // MB per ms is GB per second
  std::vector<BenchRow> rows;
  add_speeds(rows, "device read-back of 64 MiB", work, best_of([&] { return measure_read_back(device, kBytes); }),
             work / copy, "GB/s");
  return rows;
}

std::vector<BenchRow> bench_device_keys(const GpuDevice& device, const Scene& scene, const View& view, int threads,
                                        double raster_ms) {
  const GpuScene there(device, scene, std::array{SurfaceRange{0, scene.triangles}}, threads);
  GpuKeys keys(device);
  const Repetitions repetitions = device.info().software ? Repetitions{0, 1} : Repetitions{1, kKeyFrames};
  const double ms = median_times({[&] { (void)keys.draw(there, view); }}, repetitions).front();
  return {{fmt::format("device keys of {} triangles, {}x{}", scene.triangles, view.size().width, view.size().height),
           ms, raster_ms, "ms", raster_ms / ms}};
}

}  // namespace hpr
