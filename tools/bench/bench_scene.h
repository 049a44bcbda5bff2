#pragma once

#include <cstdint>

#include "scene/scene.h"

namespace hpr {

/// A sphere of 2 columns (rows - 1) triangles, its radius of one metre waved by a tenth.
[[nodiscard]] Mesh displaced_sphere(std::uint32_t rows, std::uint32_t columns);

/// What ray rates are measured on: a displaced sphere of about so many triangles among 200 instances of a sphere of a
/// fiftieth of them, over a floor, with one light.
[[nodiscard]] Scene ray_bench_scene(std::uint64_t triangles);

}  // namespace hpr
