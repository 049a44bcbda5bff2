#pragma once

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

namespace hpr {

struct Bounds {
  glm::dvec3 low{0.0};
  glm::dvec3 high{0.0};
};

/// What holds nothing: low > high.
[[nodiscard]] Bounds empty_bounds();
/// The box about both.
[[nodiscard]] Bounds united(const Bounds& a, const Bounds& b);

/// The world box of a box: the image of its centre, give or take |M| times its half extent.
[[nodiscard]] Bounds transformed(const glm::dmat4& matrix, const Bounds& box);

}  // namespace hpr
