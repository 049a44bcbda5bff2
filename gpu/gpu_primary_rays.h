#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "gpu/device/gpu_device.h"
#include "gpu/gpu_keys.h"
#include "gpu/gpu_scene.h"
#include "image/tiles.h"
#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {

/// Makes a rank's keys on a device, with the surfaces it holds from frame to frame.
class GpuPrimaryRays {
 public:
  /// `threads` build what is put on it. The device must outlive this.
  GpuPrimaryRays(const GpuDevice& device, int threads) : device_(device), threads_(threads), keys_(device) {}

  /// Draws `objects` from here on. Puts them on the device where it has not got them, and keeps those it drew before.
  /// Throws Error (Limit) where its memory ends.
  void hold(const Scene& scene, std::span<const SurfaceRange> objects);
  /// Frees what it holds: the scene changes.
  void release();

  /// Merges (maximum) the keys of `parts` of the layer's `screen` into `layer`, as PrimaryRays does; tiles become
  /// active where something is seen. After hold().
  void draw(const View& view, std::size_t screen, std::span<const Rect> parts, TileLayer<Key>& layer);

 private:
  const GpuDevice& device_;
  int threads_;
  GpuKeys keys_;
  struct Held {
    std::vector<SurfaceRange> objects;
    std::unique_ptr<GpuScene> scene;
  };
  std::array<Held, 2> held_;  ///< the first one is drawn
};

/// Whether a device can make a scene's keys: all meshes are here whole.
[[nodiscard]] bool fits_on_gpu(const Scene& scene);

}  // namespace hpr
