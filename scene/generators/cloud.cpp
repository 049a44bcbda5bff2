#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <random>
#include <utility>

#include "scene/generators/generators.h"
#include "scene/generators/portable_math.h"
#include "scene/generators/shapes.h"

namespace hpr {
namespace {

constexpr int kMaxCount = 10'000'000;
constexpr double kHeight = 1.2;  ///< of the knot's center

/// A point of the (2, 3) torus knot of outer radius 1.
glm::dvec3 knot(double turns) {
  const double ring = 2.0 + portable::cos_turns(3.0 * turns);
  return glm::dvec3(ring * portable::cos_turns(2.0 * turns), portable::sin_turns(3.0 * turns),
                    ring * portable::sin_turns(2.0 * turns)) /
         3.0;
}

/// Once around the colors.
glm::vec4 rainbow(double turns) {
  const auto channel = [&](double offset) {
    const double wave = 0.5 + 0.5 * portable::cos_turns(turns + offset);
    return static_cast<float>(0.04 + 0.9 * wave * wave);
  };
  return {channel(0.0), channel(-1.0 / 3.0), channel(1.0 / 3.0), 1.0F};
}

/// Points on a tube about the knot, each a little off it, as scanners find them.
Mesh scanned_knot(int count, std::uint32_t seed) {
  Mesh mesh;
  mesh.kind = MeshKind::Points;
  const auto points = static_cast<std::uint32_t>(count);
  mesh.positions.reserve(points);
  mesh.colors.reserve(points);
  mesh.triangles.reserve(points);
  std::mt19937 random(seed);  // the same numbers everywhere, which the library's distributions do not promise
  const auto next = [&random] { return static_cast<double>(random()) / 4294967296.0; };
  for (std::uint32_t i = 0; i < points; ++i) {
    const double t = next();
    const double around = next();
    const double off = next() - 0.5;
    constexpr double kStep = 1e-4;
    const glm::dvec3 along = glm::normalize(knot(t + kStep) - knot(t - kStep));
    const glm::dvec3 u = glm::normalize(glm::cross(along, {0.0, 1.0, 0.0}));
    const glm::dvec3 v = glm::cross(u, along);
    const double radius = 0.16 + 0.01 * off;
    const glm::dvec3 p = knot(t) + radius * (portable::cos_turns(around) * u + portable::sin_turns(around) * v);
    mesh.positions.emplace_back(p.x, p.y + kHeight, p.z);
    mesh.colors.push_back(rainbow(t));
    mesh.triangles.emplace_back(i);
  }
  return mesh;
}

void add_segment(Mesh& mesh, const glm::dvec3& from, const glm::dvec3& to) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.emplace_back(from);
  mesh.positions.emplace_back(to);
  mesh.triangles.emplace_back(first, first + 1, first + 1);
}

/// The twelve edges of a box about the knot.
Mesh box_edges() {
  Mesh mesh;
  mesh.kind = MeshKind::Lines;
  constexpr double kSide = 1.2;
  constexpr double kLow = kHeight - 0.6;
  constexpr double kHigh = kHeight + 0.6;
  for (const double a : {-1.0, 1.0}) {
    for (const double b : {-1.0, 1.0}) {
      add_segment(mesh, {-kSide, b < 0.0 ? kLow : kHigh, a * kSide}, {kSide, b < 0.0 ? kLow : kHigh, a * kSide});
      add_segment(mesh, {a * kSide, b < 0.0 ? kLow : kHigh, -kSide}, {a * kSide, b < 0.0 ? kLow : kHigh, kSide});
      add_segment(mesh, {a * kSide, kLow, b * kSide}, {a * kSide, kHigh, b * kSide});
    }
  }
  return mesh;
}

/// Lines a metre apart, above the floor by their radius as the main camera sees the far ones.
Mesh floor_grid() {
  Mesh mesh;
  mesh.kind = MeshKind::Lines;
  constexpr int kReach = 8;
  for (int i = -kReach; i <= kReach; ++i) {
    add_segment(mesh, {i, 0.02, -kReach}, {i, 0.02, kReach});
    add_segment(mesh, {-kReach, 0.02, i}, {kReach, 0.02, i});
  }
  return mesh;
}

/// The knot's center, closed.
Mesh center_line() {
  Mesh mesh;
  mesh.kind = MeshKind::Lines;
  constexpr std::uint32_t kSegments = 240;
  for (std::uint32_t i = 0; i < kSegments; ++i) {
    const double t = static_cast<double>(i) / kSegments;
    mesh.positions.emplace_back(knot(t) + glm::dvec3(0.0, kHeight, 0.0));
    mesh.colors.push_back(rainbow(t + 0.5));
    const std::uint32_t next = (i + 1) % kSegments;
    mesh.triangles.emplace_back(i, next, next);
  }
  return mesh;
}

std::uint32_t add_unlit(Scene& scene, std::string name, const glm::vec3& color) {
  Material material = plastic(std::move(name), color, 1.0F);
  material.unlit = true;
  return add_material(scene, std::move(material));
}

void fill_cloud(Scene& scene, const OptionReader& options) {
  const int count = options.integer("count", 20'000, 1, kMaxCount);
  const auto seed = static_cast<std::uint32_t>(options.integer("seed", 1, 0, 1'000'000'000));
  scene.background = {0.05F, 0.06F, 0.08F};
  const std::uint32_t floor_paint = add_material(scene, plastic("floor", glm::vec3(0.35F), 1.0F));
  const std::uint32_t mirror = add_material(scene, metal("mirror", glm::vec3(0.9F), 0.0F));
  const std::uint32_t painted = add_unlit(scene, "points", glm::vec3(1.0F));
  const std::uint32_t grey = add_unlit(scene, "grid", glm::vec3(0.12F));
  const std::uint32_t white = add_unlit(scene, "box", glm::vec3(0.9F));

  Mesh floor;
  shapes::add_quad(floor, {{{-8, 0, 8}, {8, 0, 8}, {8, 0, -8}, {-8, 0, -8}}});
  add_single(scene, std::move(floor), "floor", floor_paint);
  const std::uint32_t ball = add_mesh(scene, shapes::icosphere(4), "mirror", mirror);
  add_instance(scene, ball, shapes::placed({2.2, 0.8, -1.6}, 0.8));
  add_single(scene, scanned_knot(count, seed), "cloud", painted);
  add_single(scene, center_line(), "center line", painted);
  add_single(scene, floor_grid(), "grid", grey);
  add_single(scene, box_edges(), "box", white);

  Light sun;
  sun.name = "sun";
  sun.type = LightType::Directional;
  sun.direction = glm::vec3(glm::normalize(glm::dvec3(-0.4, -0.8, -0.45)));
  sun.intensity = glm::vec3(3.0F);
  scene.lights.push_back(sun);
  add_camera(scene, "main", {1.4, 2.3, 4.2}, {0.3, 0.9, 0}, {0, 1, 0}, 45.0);
  add_camera(scene, "inside", {0.0, 1.25, 1.4}, {0.0, 1.2, 0.0}, {0, 1, 0}, 60.0);
  add_camera(scene, "above", {0, 9, 0.1}, {0, 0, 0}, {0, 0, -1}, 45.0);
}

/// As many points as octahedra come near; the rest is a small part of larger scenes.
GeneratorOptions sized(std::uint64_t triangles) {
  constexpr std::uint64_t kRest = 9'000;
  const std::uint64_t points = triangles > kRest ? (triangles - kRest + 4) / 8 : 1;
  return {{"count", std::to_string(std::clamp<std::uint64_t>(points, 1, kMaxCount))}};
}

}  // namespace

Generator cloud_generator() {
  Generator generator;
  generator.name = "cloud";
  generator.summary = "points scattered about a torus knot, and lines, over a floor and a mirror";
  generator.options = {{"count", "points, 1 to 10000000 (default 20000)"},
                       {"seed", "of the points' places, 0 to 1000000000 (default 1)"}};
  generator.sized = sized;
  return filled_by(std::move(generator), fill_cloud);
}

}  // namespace hpr
