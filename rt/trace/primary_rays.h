#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "image/key.h"
#include "image/tiles.h"
#include "rt/ray_counts.h"
#include "rt/trace/occupied_pixels.h"
#include "rt/trace/ray_scene.h"
#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {

/// Makes keys by one ray through each pixel's centre: what Rasterizer makes, from Embree.
///
/// A key's depth is computed in double from the triangle and the pixel's ray, and the largest key among the triangles
/// the ray meets stays, exactly as compositing would have it. So the same screen gives the same keys however its area
/// is cut into parts, however its triangles are dealt to ranks, and with any number of threads. Against the
/// rasteriser's, other surfaces are seen in the pixels whose centre lies on an edge but for rounding.
///
/// A triangle counts as met where Embree's robust test says so and its distance is right to a thousandth of the scene's
/// radius: on slivers seen edge-on it may be far off (Embree issue 387). Closer to edge-on than 1/4000, a surface may
/// thus have holes, which a pixel is too large to show.
class PrimaryRays {
 public:
  /// `rays` holds the share of `scene` to draw; both must outlive it.
  PrimaryRays(const Scene& scene, const RayScene& rays, int threads);

  /// Merges (maximum) the keys of `parts` of the layer's `screen` into `layer`; tiles become active where something is
  /// seen. `view` is as large as that screen; parts are in its pixels and may reach past it.
  void draw(const View& view, std::size_t screen, std::span<const Rect> parts, TileLayer<Key>& layer);
  /// Draws several views together that differ by their jitter only, at most kMaxViews: rays through one pixel are
  /// quicker in one packet. Keys of views[i] go to layers[i]; they are those that draw() of each view would make. Where
  /// pixels are not `wanted`, which is all of them when null, there are none.
  void draw(std::span<const View> views, std::size_t screen, std::span<const Rect> parts,
            std::span<TileLayer<Key>* const> layers, const PixelMask* wanted = nullptr);
  static constexpr std::size_t kMaxViews = 16;

  /// Of the last draw().
  [[nodiscard]] const PrimaryRayStats& stats() const { return stats_; }
  [[nodiscard]] std::span<const TileCost> costs() const { return costs_; }

 private:
  const Scene& scene_;
  const RayScene& rays_;
  int threads_;
  MeshBoxes boxes_;
  PrimaryRayStats stats_;
  std::vector<TileCost> costs_;
};

}  // namespace hpr
