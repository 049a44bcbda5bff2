#pragma once

#include <glm/vec3.hpp>
#include <vector>

namespace hpr {

/// A sphere of the flake and the axis it grew along (unit length).
struct FlakeSphere {
  glm::dvec3 center{0.0};
  double radius = 0.0;
  glm::dvec3 axis{0.0, 0.0, 1.0};
};

/// Haines' sphereflake ("A Proposal for Standard Graphics Environments", IEEE CG&A 7(11), 1987) in the coordinates of
/// the Standard Procedural Databases: left-handed, z up, a root of radius 1/2 at the origin. `size` generations after
/// the root: (9^(size + 1) - 1) / 8 spheres, every sphere before its children.
[[nodiscard]] std::vector<FlakeSphere> sphereflake(int size);

/// From the databases' left-handed, z-up coordinates to ours, right-handed and y up: y and z change places, which is
/// the negation of one axis that handedness needs and a quarter turn in one. Pictures stay the same.
[[nodiscard]] inline glm::dvec3 from_spd(const glm::dvec3& p) {
  return {p.x, p.z, p.y};
}

}  // namespace hpr
