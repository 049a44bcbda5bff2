#pragma once

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <span>

#include "scene/scene.h"

namespace hpr {

/// What holds nothing: low > high.
[[nodiscard]] Bounds empty_bounds();
/// The box about both.
[[nodiscard]] Bounds united(const Bounds& a, const Bounds& b);

/// The box of the positions a mesh uses, or some triangles of it, in its own coordinates; empty when there are none.
[[nodiscard]] Bounds mesh_bounds(const Mesh& mesh);
[[nodiscard]] Bounds bounds_of(const Mesh& mesh, std::span<const glm::uvec3> triangles);

/// The world box of a box: the image of its centre, give or take |M| times its half extent.
[[nodiscard]] Bounds transformed(const glm::dmat4& matrix, const Bounds& box);

}  // namespace hpr
