#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "app/options/globals.h"
#include "gpu/device/gpu_device.h"
#include "gpu/gpu_ray_batch.h"
#include "raster/gl_context.h"
#include "scene/scene.h"
#include "scene/view.h"
#include "tools/bench/bench.h"

namespace hpr {

/// Whether rows of a device belong to a measurement: Vulkan was asked for.
[[nodiscard]] bool measures_device(const Globals& globals);

/// OpenGL by these settings: of its own choice, where they ask for Vulkan.
[[nodiscard]] GlOptions gl_options(const Globals& globals, int threads);

/// The device of `--backend vulkan`, as a session takes it.
[[nodiscard]] std::unique_ptr<GpuDevice> device_of(const Globals& globals);

/// Rays that a device and bare Embree have traced.
struct DeviceRays {
  std::string_view name;
  GpuRayBatch::Query query;
  std::vector<GpuRay> rays;
  double embree_ms = 0.0;  ///< of one thread
  std::uint64_t embree_hits = 0;
};

/// Thousand million rays per second of a device beside one thread of bare Embree: by the device's clock, where it has
/// one, and by the CPU's. Best of five. Throws Error (CheckFailed) where more than one in a thousand meets something in
/// one of both alone.
[[nodiscard]] std::vector<BenchRow> bench_device_rays(const GpuDevice& device, const Scene& scene,
                                                      std::span<const DeviceRays> sets);

/// GB/s from a device's memory into the CPU's, beside a copy in the CPU's own.
[[nodiscard]] std::vector<BenchRow> bench_read_back(const GpuDevice& device);

/// The keys of a view by a device, brought into the CPU's memory, beside `raster_ms` of OpenGL.
[[nodiscard]] std::vector<BenchRow> bench_device_keys(const GpuDevice& device, const Scene& scene, const View& view,
                                                      int threads, double raster_ms);

}  // namespace hpr
