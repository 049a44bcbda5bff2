#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "core/error.h"
#include "scene/generators/generators.h"
#include "scene/generators/portable_math.h"
#include "scene/generators/shapes.h"

namespace hpr {
namespace {

/// The nine directions children grow in, about the axis z.
std::array<glm::dvec3, 9> child_directions() {
  std::array<glm::dvec3, 9> directions;
  for (int i = 0; i < 6; ++i) {
    const double turns = (15.0 + 60.0 * i) / 360.0;
    directions[static_cast<std::size_t>(i)] = {portable::cos_turns(turns), portable::sin_turns(turns), 0.0};
  }
  const double sine = std::sqrt(2.0 / 3.0);
  const double cosine = std::sqrt(1.0 / 3.0);
  for (int i = 0; i < 3; ++i) {
    const double turns = (45.0 + 120.0 * i) / 360.0;
    directions[6 + static_cast<std::size_t>(i)] = {cosine * portable::cos_turns(turns),
                                                   cosine * portable::sin_turns(turns), sine};
  }
  return directions;
}

/// `v` turned by the smallest rotation that takes z to `axis`. Opposite to z there are many; half a turn about x is
/// taken, also for the axes that rounding leaves a little beside -z.
glm::dvec3 turned(const glm::dvec3& v, const glm::dvec3& axis) {
  if (axis.z < -1.0 + 1e-9) return {v.x, -v.y, -v.z};
  const glm::dvec3 k(-axis.y, axis.x, 0.0);  // z x axis, of length sin
  return v * axis.z + glm::cross(k, v) + k * (glm::dot(k, v) / (1.0 + axis.z));
}

std::uint64_t sphere_count(int size) {
  std::uint64_t count = 0;
  for (int i = 0; i <= size; ++i) count = 9 * count + 1;
  return count;
}

void fill_sphereflake(Scene& scene, const OptionReader& options) {
  const int size = options.integer("s", 4, 0, 6);
  const int n = options.integer("n", 4, 1, 64);
  scene.background = {0.078F, 0.361F, 0.753F};

  const std::uint32_t floor_paint = add_material(scene, plastic("floor", {1.0F, 0.75F, 0.33F}, 1.0F));
  // Half diffuse and half mirror, both in the sphere's colour: what metallic 1/2 means.
  Material shiny = metal("sphere", {1.0F, 0.9F, 0.7F}, 0.0F);
  shiny.metallic = 0.5F;
  const std::uint32_t sphere_paint = add_material(scene, std::move(shiny));

  Mesh floor;
  shapes::add_quad(floor, {from_spd({-12, -12, -0.5}), from_spd({-12, 12, -0.5}), from_spd({12, 12, -0.5}),
                           from_spd({12, -12, -0.5})});
  add_single(scene, std::move(floor), "floor", floor_paint);
  const std::uint32_t sphere = add_mesh(scene, shapes::cube_sphere(n), "sphere", sphere_paint);
  for (const FlakeSphere& s : sphereflake(size)) {
    add_instance(scene, sphere, shapes::placed(from_spd(s.center), s.radius));
  }

  const std::array<glm::dvec3, 3> lights{{{4, 3, 2}, {1, -4, 4}, {-3, 1, 5}}};
  for (const glm::dvec3& light : lights) add_spd_light(scene, light, std::numbers::pi * std::sqrt(3.0) / 6.0);
  const glm::dvec3 up = from_spd({0, 0, 1});
  add_camera(scene, "main", from_spd({2.1, 1.3, 1.7}), {0, 0, 0}, up, 45.0);
  add_camera(scene, "close", from_spd({0.9, 0.5, 0.9}), from_spd({0, 0, 0.25}), up, 45.0);
}

GeneratorOptions sized(std::uint64_t triangles) {
  std::vector<SceneSize> sizes;
  for (int size = 0; size <= 6; ++size) {
    for (int n = 2; n <= 8; ++n) {
      sizes.push_back({sphere_count(size) * 12 * static_cast<std::uint64_t>(n * n) + 2,
                       {{"s", std::to_string(size)}, {"n", std::to_string(n)}}});
    }
  }
  return nearest_size(sizes, triangles);
}

}  // namespace

std::vector<FlakeSphere> sphereflake(int size) {
  HPR_CHECK(size >= 0 && size <= 6);
  const std::array<glm::dvec3, 9> directions = child_directions();
  std::vector<FlakeSphere> spheres;
  spheres.reserve(sphere_count(size));
  spheres.push_back({{0, 0, 0}, 0.5, {0, 0, 1}});
  for (std::size_t parent = 0; spheres.size() < sphere_count(size); ++parent) {
    const FlakeSphere s = spheres[parent];
    for (const glm::dvec3& direction : directions) {
      const glm::dvec3 axis = glm::normalize(turned(direction, s.axis));
      spheres.push_back({s.center + axis * (4.0 / 3.0 * s.radius), s.radius / 3.0, axis});
    }
  }
  return spheres;
}

Generator sphereflake_generator() {
  Generator generator;
  generator.name = "sphereflake";
  generator.summary = "Haines' \"balls\": mirroring spheres on spheres, (9^(s+1) - 1) / 8 of them, on a square";
  generator.options = {{"s", "generations after the first sphere, 0 to 6 (default 4: 7381 spheres)"},
                       {"n", "squares along a cube face of each sphere: 12 n^2 triangles, 1 to 64 (default 4)"}};
  generator.sized = sized;
  return filled_by(std::move(generator), fill_sphereflake);
}

}  // namespace hpr
