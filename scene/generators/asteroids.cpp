#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <numbers>
#include <utility>

#include "scene/generators/generators.h"
#include "scene/generators/portable_math.h"
#include "scene/generators/shapes.h"

namespace hpr {
namespace {

constexpr int kRocks = 16;
constexpr int kMaxCount = 1'000'000;

double lattice_value(std::int64_t x, std::int64_t y, std::int64_t z, std::uint32_t seed) {
  const auto u = [](std::int64_t v) { return static_cast<std::uint32_t>(v); };
  std::uint32_t h = u(x) * 0x8da6b343U ^ u(y) * 0xd8163841U ^ u(z) * 0xcb1ab31fU ^ seed * 0x9e3779b9U;
  h ^= h >> 13U;
  h *= 0x5bd1e995U;
  h ^= h >> 15U;
  return (h >> 8U) / 8388608.0 - 1.0;
}

/// Value noise in [-1, 1]: lattice values faded into one another by 6 t^5 - 15 t^4 + 10 t^3.
double noise(const glm::dvec3& p, std::uint32_t seed) {
  const glm::dvec3 cell(std::floor(p.x), std::floor(p.y), std::floor(p.z));
  const glm::dvec3 t = p - cell;
  const glm::dvec3 fade = t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
  const auto x = static_cast<std::int64_t>(cell.x);
  const auto y = static_cast<std::int64_t>(cell.y);
  const auto z = static_cast<std::int64_t>(cell.z);
  const auto mix = [](double a, double b, double f) { return a + (b - a) * f; };
  const auto along_x = [&](std::int64_t dy, std::int64_t dz) {
    return mix(lattice_value(x, y + dy, z + dz, seed), lattice_value(x + 1, y + dy, z + dz, seed), fade.x);
  };
  return mix(mix(along_x(0, 0), along_x(1, 0), fade.y), mix(along_x(0, 1), along_x(1, 1), fade.y), fade.z);
}

/// The distance of a rock's surface from its centre, in direction `d`.
double rock_radius(const glm::dvec3& d, int rock, std::uint32_t seed) {
  // Every rock is cut from another part of the noise, far from its neighbour's.
  const glm::dvec3 offset(31.0 * (rock + 1));
  double radius = 1.0;
  for (int octave = 0; octave < 6; ++octave) {
    const double frequency = portable::exp2(octave);
    radius += 0.35 * portable::exp2(-0.9 * octave) * noise(frequency * 1.7 * d + offset, seed);
  }
  return std::clamp(radius, 0.4, 1.8);
}

Mesh rock_mesh(const Mesh& sphere, int rock, std::uint32_t seed) {
  Mesh mesh = sphere;
  for (glm::vec3& p : mesh.positions) {
    const glm::dvec3 d = glm::normalize(glm::dvec3(p));
    p = glm::vec3(rock_radius(d, rock, seed) * d);
  }
  mesh.normals = smooth_normals(mesh.positions, mesh.triangles);
  return mesh;
}

/// The radical inverse of `i`: its digits in `base` mirrored at the point (Halton 1960).
double halton(int i, int base) {
  double result = 0.0;
  double digit = 1.0;
  for (; i > 0; i /= base) {
    digit /= base;
    result += digit * (i % base);
  }
  return result;
}

/// A uniformly distributed rotation from three numbers in [0, 1) (Shoemake, "Uniform Random Rotations", 1992).
glm::dmat3 rotation(double u1, double u2, double u3) {
  const double a = std::sqrt(1.0 - u1);
  const double b = std::sqrt(u1);
  const double x = a * portable::sin_turns(u2);
  const double y = a * portable::cos_turns(u2);
  const double z = b * portable::sin_turns(u3);
  const double w = b * portable::cos_turns(u3);
  return {{1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)},
          {2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)},
          {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)}};
}

/// Where asteroid `i` lies in the belt about the y axis.
glm::dmat4 place_in_belt(int i) {
  const double turns = halton(i, 2);
  const double radius = 60.0 + 80.0 * std::sqrt(halton(i, 3));
  const double w = 2.0 * halton(i, 5) - 1.0;
  constexpr double kLog20 = 4.321928094887363;  // to base 2: sizes span a factor of 20
  const double size = 0.15 * portable::exp2(kLog20 * halton(i, 7));
  const glm::dmat3 turned = rotation(halton(i, 11), halton(i, 13), halton(i, 17));
  glm::dmat4 matrix(turned * size);
  matrix[3] =
      glm::dvec4(radius * portable::cos_turns(turns), 10.0 * w * w * w, radius * portable::sin_turns(turns), 1.0);
  return matrix;
}

void fill_asteroids(Scene& scene, const OptionReader& options) {
  const int level = options.integer("k", 3, 1, 7);
  const int count = options.integer("count", 80, 1, kMaxCount);
  const auto seed = static_cast<std::uint32_t>(options.integer("seed", 1, 0, 1'000'000'000));
  scene.background = {0.004F, 0.005F, 0.008F};
  const std::uint32_t stone = add_material(scene, plastic("rock", {0.36F, 0.31F, 0.27F}, 0.9F));
  const std::uint32_t mirror = add_material(scene, metal("mirror metal", {0.9F, 0.88F, 0.85F}, 0.0F));
  const std::uint32_t clear = add_material(scene, glass("glass", 1.5F));

  const Mesh sphere = shapes::icosphere(level);
  std::array<Mesh, kRocks> rocks;
  for (int rock = 0; rock < std::min(kRocks, count); ++rock) {
    rocks[static_cast<std::size_t>(rock)] = rock_mesh(sphere, rock, seed);
  }
  std::map<std::pair<int, std::uint32_t>, std::uint32_t> meshes;  // by rock and material, made when first needed
  for (int i = 0; i < count; ++i) {
    const int rock = i % kRocks;
    const std::uint32_t material = i % 50 == 24 ? mirror : i % 50 == 49 ? clear : stone;
    const auto [entry, added] = meshes.try_emplace({rock, material});
    if (added) {
      entry->second = add_mesh(scene, rocks[static_cast<std::size_t>(rock)],
                               fmt::format("{} {}", scene.materials[material].name, rock), material);
    }
    add_instance(scene, entry->second, place_in_belt(i + 1));
  }

  Light sun;
  sun.name = "sun";
  sun.type = LightType::Directional;
  sun.direction = glm::vec3(glm::normalize(glm::dvec3(-0.5, -0.6, -0.6)));
  sun.intensity = glm::vec3(4.0F, 3.9F, 3.7F);
  scene.lights.push_back(sun);
  add_camera(scene, "main", {0, 30, 190}, {0, 0, 40}, {0, 1, 0}, 45.0);
  add_camera(scene, "belt", {100, 2, 20}, {80, 0, -60}, {0, 1, 0}, 50.0);
  add_camera(scene, "above", {0, 330, 1}, {0, 0, 0}, {0, 0, -1}, 50.0);
}

/// The coarsest level that needs no more than a thousand asteroids, and as many as fit.
GeneratorOptions sized(std::uint64_t triangles) {
  int level = 3;
  std::uint64_t each = 1280;
  for (; level < 7 && triangles > 1000 * each; ++level) each *= 4;
  const std::uint64_t count = std::clamp<std::uint64_t>((triangles + each / 2) / each, 1, kMaxCount);
  return {{"k", std::to_string(level)}, {"count", std::to_string(count)}};
}

}  // namespace

Generator asteroids_generator() {
  Generator generator;
  generator.name = "asteroids";
  generator.summary = "a belt of displaced spheres, 10^4 to 10^9 triangles of 16 rocks by instancing";
  generator.options = {{"k", "icosphere level of the rocks, 20 * 4^k triangles each, 1 to 7 (default 3)"},
                       {"count", "asteroids, 1 to 1000000 (default 80)"},
                       {"seed", "of the rocks' shapes, 0 to 1000000000 (default 1)"}};
  generator.sized = sized;
  return filled_by(std::move(generator), fill_asteroids);
}

}  // namespace hpr
