#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gpu/gpu_device.h"
#include "gpu/gpu_keys.h"
#include "gpu/gpu_scene.h"
#include "image/tiles.h"
#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {

/// A device that makes a rank's keys, with the surfaces it holds from frame to frame.
class GpuPrimaryRays {
 public:
  explicit GpuPrimaryRays(const GpuOptions& options) : device_(options), keys_(device_) {}

  [[nodiscard]] const GpuInfo& info() const { return device_.info(); }

  /// Puts `objects` on the device; nothing where it has them. Throws Error (Limit) where its memory ends.
  void hold(const Scene& scene, std::span<const SurfaceRange> objects);
  /// Frees what it holds: the scene changes.
  void release();

  /// Merges (maximum) the keys of `parts` of the layer's `screen` into `layer`, as PrimaryRays does; tiles become
  /// active where something is seen. After hold().
  void draw(const View& view, std::size_t screen, std::span<const Rect> parts, TileLayer<Key>& layer);

 private:
  GpuDevice device_;
  GpuKeys keys_;
  std::vector<SurfaceRange> objects_;
  std::optional<GpuScene> scene_;
};

/// Whether a device can make a scene's keys: all meshes are here whole.
[[nodiscard]] bool fits_on_gpu(const Scene& scene);

}  // namespace hpr
