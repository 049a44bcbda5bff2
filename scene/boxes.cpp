#include "scene/boxes.h"

#include <glm/common.hpp>
#include <limits>

namespace hpr {

Bounds empty_bounds() {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  return {glm::dvec3(kInfinity), glm::dvec3(-kInfinity)};
}

Bounds united(const Bounds& a, const Bounds& b) {
  return {glm::min(a.low, b.low), glm::max(a.high, b.high)};
}

Bounds mesh_bounds(const Mesh& mesh) {
  return bounds_of(mesh, mesh.triangles);
}

Bounds bounds_of(const Mesh& mesh, std::span<const glm::uvec3> triangles) {
  Bounds bounds = empty_bounds();
  for (const glm::uvec3& triangle : triangles) {
    for (int corner = 0; corner < 3; ++corner) {
      const glm::dvec3 p(mesh.positions[triangle[corner]]);
      bounds.low = glm::min(bounds.low, p);
      bounds.high = glm::max(bounds.high, p);
    }
  }
  return bounds;
}

Bounds transformed(const glm::dmat4& matrix, const Bounds& box) {
  const glm::dvec3 half = 0.5 * (box.high - box.low);
  const glm::dvec3 center = glm::dvec3(matrix * glm::dvec4(0.5 * (box.low + box.high), 1.0));
  glm::dvec3 reach(0.0);
  for (int axis = 0; axis < 3; ++axis) reach += glm::abs(glm::dvec3(matrix[axis])) * half[axis];
  return {center - reach, center + reach};
}

}  // namespace hpr
