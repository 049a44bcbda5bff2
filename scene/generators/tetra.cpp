#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "scene/generators/generators.h"
#include "scene/generators/shapes.h"

namespace hpr {
namespace {

constexpr int kMaxSize = 12;
/// Levels in one mesh; the levels above are instances of it, exact since all factors are powers of two.
constexpr int kMeshSize = 8;

/// The four corners of the cube [-1, 1]^3 with x y z = +1.
constexpr std::array<std::array<int, 3>, 4> kCorners{{{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}}};

/// Centres of the 4^levels sub-cubes of half-width 2^-levels inside the cube of half-width 1.
std::vector<glm::dvec3> sub_cubes(int levels) {
  std::vector<glm::dvec3> centers{glm::dvec3(0.0)};
  double half = 1.0;
  for (int level = 0; level < levels; ++level) {
    half *= 0.5;
    std::vector<glm::dvec3> finer;
    finer.reserve(4 * centers.size());
    for (const glm::dvec3& center : centers) {
      for (const auto& [x, y, z] : kCorners) finer.push_back(center + half * glm::dvec3(x, y, z));
    }
    centers = std::move(finer);
  }
  return centers;
}

void add_tetrahedron(Mesh& mesh, const glm::dvec3& center, double half) {
  std::array<glm::dvec3, 4> corners;
  for (std::size_t i = 0; i < 4; ++i) {
    corners[i] = center + half * glm::dvec3(kCorners[i][0], kCorners[i][1], kCorners[i][2]);
  }
  for (std::size_t apex = 0; apex < 4; ++apex) {
    const glm::dvec3 a = corners[(apex + 1) % 4];
    glm::dvec3 b = corners[(apex + 2) % 4];
    glm::dvec3 c = corners[(apex + 3) % 4];
    if (glm::dot(glm::cross(b - a, c - a), corners[apex] - a) > 0.0) std::swap(b, c);
    const glm::vec3 normal(glm::normalize(glm::cross(b - a, c - a)));
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (const glm::dvec3& p : {a, b, c}) {
      mesh.positions.emplace_back(from_spd(p));
      mesh.normals.emplace_back(from_spd(normal));
    }
    // from_spd mirrors, so the winding turns round with it.
    mesh.triangles.emplace_back(first, first + 2, first + 1);
  }
}

void fill_tetra(Scene& scene, const OptionReader& options) {
  const int size = options.integer("s", 6, 1, kMaxSize);
  const int in_mesh = std::min(size, kMeshSize);
  scene.background = {0.078F, 0.361F, 0.753F};
  const std::uint32_t paint = add_material(scene, plastic("tetrahedron", {0.8F, 0.16F, 0.16F}, 1.0F));

  Mesh mesh;
  for (const glm::dvec3& center : sub_cubes(in_mesh - 1)) {
    add_tetrahedron(mesh, center, std::ldexp(1.0, 1 - in_mesh));
  }
  const std::uint32_t block = add_mesh(scene, std::move(mesh), "tetrahedra", paint);
  for (const glm::dvec3& center : sub_cubes(size - in_mesh)) {
    add_instance(scene, block, shapes::placed(from_spd(center), std::ldexp(1.0, in_mesh - size)));
  }

  add_spd_light(scene, {2, -18, -5}, std::numbers::pi * 0.5);
  add_camera(scene, "main", from_spd({1.022846, -3.177154, -2.174512}), from_spd({-0.004103, -0.004103, 0.216539}),
             from_spd({-0.816497, -0.816497, 0.816497}), 45.0);
}

GeneratorOptions sized(std::uint64_t triangles) {
  std::vector<SceneSize> sizes;
  for (int size = 1; size <= kMaxSize; ++size) {
    sizes.push_back({std::uint64_t{1} << static_cast<unsigned>(2 * size), {{"s", std::to_string(size)}}});
  }
  return nearest_size(sizes, triangles);
}

}  // namespace

Generator tetra_generator() {
  Generator generator;
  generator.name = "tetra";
  generator.summary = "Haines' \"tetra\": Sierpinski's pyramid of 4^s tiny triangles, mostly empty space";
  generator.options = {{"s", "levels, 1 to 12 (default 6: 4096 triangles; above 8 the mesh is instanced)"}};
  generator.sized = sized;
  return filled_by(std::move(generator), fill_tetra);
}

}  // namespace hpr
