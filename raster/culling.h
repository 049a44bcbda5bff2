#pragma once

#include <array>
#include <glm/mat4x4.hpp>
#include <glm/vec4.hpp>

#include "raster/geometry.h"
#include "scene/view.h"

namespace hpr {

/// Decides in double what boxes of one mesh, under one matrix, can touch inside a rectangle of a view. Conservative
/// against what GL does in float: a box is outside only when every point of it is, by more than the rounding of
/// GL's transform and clipping, plus a pixel for its snapping to sub-pixels.
///
/// Why a plane test is enough: a triangle's visible points have w > 0 and are convex combinations of its corners, so
/// where x - n w < 0 holds for all corners, whatever the sign of their w, x / w < n holds for all that is visible
/// (Blinn and Newell, Clipping Using Homogeneous Coordinates, 1978).
class Culler {
 public:
  /// `clip_from_mesh`: as composed in double, before the cast to float. `part`: inside the view, not empty.
  Culler(const glm::dmat4& clip_from_mesh, const View& view, const Rect& part);

  /// Nothing in the box can be drawn inside the part.
  [[nodiscard]] bool outside(const Box& box) const;
  /// Everything in the box lies inside the part and before the near plane, so no smaller box in it is outside.
  [[nodiscard]] bool inside(const Box& box) const;
  /// A rectangle of the part that holds every pixel the box's content can touch.
  [[nodiscard]] Rect pixels(const Box& box) const;

 private:
  static constexpr std::size_t kPlanes = 6;
  static constexpr std::size_t kNear = 4;

  /// Whether rounding may turn the sign of w where GL cuts the box's triangles at the near plane. Nothing can be said
  /// about where such a triangle ends up.
  [[nodiscard]] bool near_breaks_down(const Box& box) const;

  Rect part_;
  Size size_;
  double near_ = 0.0;  ///< w at the near plane; 0: orthographic, w is 1 everywhere
  glm::dmat4 matrix_;
  std::array<glm::dvec4, kPlanes> planes_{};  ///< left, right, bottom, top, near, far: positive inside
  std::array<glm::dvec4, kPlanes> error_{};   ///< dotted with (|position|, 1): what GL's float may be off by
  std::array<glm::dvec4, 4> row_error_{};     ///< the same for clip x, y, z, w
};

}  // namespace hpr
