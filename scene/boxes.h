#pragma once

#include <glm/mat4x4.hpp>

#include "scene/scene.h"

namespace hpr {

/// The box of a mesh's used positions in its own coordinates; empty (low > high) when there are none.
[[nodiscard]] Bounds mesh_bounds(const Mesh& mesh);

/// The world box of a box: the image of its centre, give or take |M| times its half extent.
[[nodiscard]] Bounds transformed(const glm::dmat4& matrix, const Bounds& box);

}  // namespace hpr
