#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "scene/scene.h"

/// What the subcommands of `hpr bench` share: their rows and the scenes they measure on.
namespace hpr {

/// One line of `hpr bench`: what we need for something, and what a floor or peer needs for it on the same input.
struct BenchRow {
  std::string name;
  double ours = 0.0;
  double floor = 0.0;  ///< 0: there is none
  std::string unit;
  double ratio = 0.0;  ///< our speed / the floor's: 1 is equal, more is faster; 0 without a floor
};

/// Prints rows as a table, or as one JSON document (schema hpr.bench/1). `machine`: what they were measured on.
void print_bench(const std::vector<BenchRow>& rows, const std::string& machine, bool json);

/// A sphere of 2 columns (rows - 1) triangles, its radius of one metre waved by a tenth.
[[nodiscard]] Mesh displaced_sphere(std::uint32_t rows, std::uint32_t columns);

/// What ray rates are measured on: a displaced sphere of about so many triangles among 200 instances of a sphere of a
/// fiftieth of them, over a floor, with one light.
[[nodiscard]] Scene ray_bench_scene(std::uint64_t triangles);

}  // namespace hpr
