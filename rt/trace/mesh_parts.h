#pragma once

#include <cstdint>
#include <vector>

#include "scene/scene.h"

namespace hpr {

/// Which part of its mesh each triangle belongs to: triangles are of one part that share a place, by whatever vertices.
/// Numbers from 0, in the order of each part's first triangle. O(n log n).
[[nodiscard]] std::vector<std::uint32_t> parts_of(const Mesh& mesh);

}  // namespace hpr
