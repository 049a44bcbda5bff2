#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "gpu/device/gpu_batch.h"
#include "gpu/device/gpu_buffer.h"
#include "gpu/device/gpu_device.h"
#include "gpu/device/gpu_kernel.h"
#include "gpu/gpu_scene.h"
#include "image/image.h"
#include "image/key.h"
#include "scene/view.h"

namespace hpr {

/// Makes keys by one ray through each pixel's centre: what PrimaryRays makes, on a device.
///
/// Depths are computed in double, in the steps and the order of the CPU's, and the largest key among the triangles a
/// ray meets stays: the same scene gives the same keys however its surfaces are dealt out. Against PrimaryRays other
/// surfaces are seen where a ray meets an edge but for rounding, and depths of very large triangles, which the CPU
/// meets in parts, differ in their last bits.
class GpuKeys {
 public:
  explicit GpuKeys(const GpuDevice& device);

  /// The keys of a view, which has no points (View::points), as large as it. Throws Error: Limit where a software
  /// device gives up a ray that meets too much.
  [[nodiscard]] Image<Key> draw(const GpuScene& scene, const View& view);

 private:
  /// Some rows of it.
  void draw_band(const GpuScene& scene, const View& band, std::span<Key> pixels);

  const GpuDevice& device_;
  const GpuKernel& kernel_;
  GpuBuffer view_;
  std::optional<GpuBuffer> keys_;
  std::optional<GpuBuffer> read_;
  GpuBatch batch_;
};

}  // namespace hpr
