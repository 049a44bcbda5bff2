#pragma once

#include <algorithm>
#include <cmath>
#include <glm/vec2.hpp>

namespace hpr {

/// Barycentric coordinates moved onto the triangle; its middle where they are undefined (a triangle seen edge-on).
[[nodiscard]] inline glm::dvec2 onto_triangle(double u, double v) {
  if (!std::isfinite(u) || !std::isfinite(v)) return glm::dvec2(1.0 / 3.0);
  u = std::max(u, 0.0);
  v = std::max(v, 0.0);
  const double sum = std::max(u + v, 1.0);
  return {u / sum, v / sum};
}

}  // namespace hpr
