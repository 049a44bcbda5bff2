#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "rt/trace/ray_scene.h"
#include "scene/scene.h"

namespace hpr {

/// Axis-aligned, in ray space.
struct RayBox {
  std::array<float, 3> low{};
  std::array<float, 3> high{};
};

/// Boxes are wider by this much of the larger of their coordinates and the scene, so that no rounding on the way to a
/// triangle, through an instance's coordinates too, takes it out of its box.
inline constexpr float kBoxSlack = 1e-4F;

/// About all of them.
[[nodiscard]] RayBox enclosing_box(std::span<const RayBox> boxes);

/// Boxes about the surfaces of `part`, 16 at most: few enough to be tried one by one, many enough that empty space
/// between surfaces is left out.
[[nodiscard]] std::vector<RayBox> enclosing_boxes(const Scene& scene, const RaySpace& space,
                                                  std::span<const SurfaceRange> part);

/// A ray as boxes are met by it.
struct BoxedRay {
  std::array<float, 3> origin;
  std::array<float, 3> per_step;  ///< 1 / direction
  float reach;

  explicit BoxedRay(const RayBatch::Ray& ray) : origin(ray.origin), per_step(), reach(ray.reach) {
    for (std::size_t axis = 0; axis < 3; ++axis) per_step[axis] = 1.0F / ray.direction[axis];
  }

  /// Or nearly. What is no number, of a line along a box's side, excludes nothing: the first argument stays.
  [[nodiscard]] bool meets(const RayBox& box) const {
    float from = 0.0F;
    float to = reach;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float a = (box.low[axis] - origin[axis]) * per_step[axis];
      const float b = (box.high[axis] - origin[axis]) * per_step[axis];
      from = std::max(from, std::min(a, b));
      to = std::min(to, std::max(a, b));
    }
    return from <= to + kBoxSlack * std::max(1.0F, to);
  }
};

}  // namespace hpr
