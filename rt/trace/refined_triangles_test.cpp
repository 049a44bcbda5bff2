#include "rt/trace/refined_triangles.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

#include "rt/sampling/sampler.h"
#include "rt/sampling/sampling.h"
#include "rt/test_scene.h"
#include "rt/trace/surfaces.h"

namespace hpr {
namespace {

glm::dmat4 tilted() {
  const glm::dmat4 about_z = glm::rotate(glm::dmat4(1.0), glm::radians(30.0), glm::dvec3(0, 0, 1));
  return glm::rotate(about_z, glm::radians(20.0), glm::dvec3(1, 0, 0));
}

/// A square of so many metres from its midpoint to a side, and a small one a metre above the midpoint.
Scene ground(double half_size, const glm::dmat4& turned) {
  Scene scene;
  const auto size = static_cast<float>(half_size);
  const std::uint32_t used = test::add_material(scene, test::diffuse());
  const Mesh wide = test::quad({-size, 0, -size}, {0, 0, 2 * size}, {2 * size, 0, 0}, used);
  test::place_mesh(scene, test::add_mesh(scene, wide), turned);
  const Mesh small = test::quad({-0.5F, 1, -0.5F}, {0, 0, 1}, {1, 0, 0}, used);
  test::place_mesh(scene, test::add_mesh(scene, small), turned);
  finish_scene(scene);
  return scene;
}

std::vector<std::uint8_t> refined(const Scene& scene) {
  return refined_instances(scene, RaySpace(scene));
}

TEST(RefinedTriangles, AreThoseOfWideGrounds) {
  EXPECT_EQ(refined(ground(1e6, tilted())), (std::vector<std::uint8_t>{1, 0}));
  EXPECT_EQ(refined(ground(1e6, glm::dmat4(1.0))), (std::vector<std::uint8_t>{1, 0})) << "its edges round";
  EXPECT_EQ(refined(ground(10.0, glm::dmat4(1.0))), (std::vector<std::uint8_t>{0, 0}));
}

TEST(RefinedTriangles, AreNoneOfFineMeshes) {
  Scene scene;
  const std::uint32_t used = test::add_material(scene, test::diffuse());
  constexpr int kSide = 200;
  Mesh grid;
  for (int z = 0; z <= kSide; ++z) {
    for (int x = 0; x <= kSide; ++x) grid.positions.emplace_back(x, 0, z);
  }
  for (std::uint32_t i = 0; i < kSide * kSide; ++i) {
    const std::uint32_t corner = i / kSide * (kSide + 1) + i % kSide;
    grid.triangles.emplace_back(corner, corner + kSide + 1, corner + 1);
    grid.triangles.emplace_back(corner + 1, corner + kSide + 1, corner + kSide + 2);
  }
  grid.material = used;
  test::place_mesh(scene, test::add_mesh(scene, grid));
  finish_scene(scene);
  EXPECT_EQ(refined(scene), (std::vector<std::uint8_t>{0})) << "though the origin lies in it";
}

TEST(RefinedTriangles, AreThoseOfSharedMeshesToo) {
  Scene scene;
  const std::uint32_t used = test::add_material(scene, test::diffuse());
  const std::uint32_t mesh = test::add_mesh(scene, test::quad({-1, 0, -1}, {0, 0, 2}, {2, 0, 0}, used));
  test::place_mesh(scene, mesh, glm::scale(glm::dmat4(1.0), glm::dvec3(1e6)));
  test::place_mesh(scene, mesh, glm::translate(glm::dmat4(1.0), {0.0, 1.0, 0.0}));
  test::place_mesh(scene, mesh, glm::translate(glm::dmat4(1.0), {2.0, 1.0, 0.0}));
  finish_scene(scene);
  EXPECT_EQ(refined(scene), (std::vector<std::uint8_t>{1, 0, 0}));
  const RayScene rays(scene, RaySpace(scene), 1);
  EXPECT_NE(rays.geometries()[0].triangles, nullptr);
  EXPECT_EQ(rays.geometries()[1].triangles, nullptr);
}

TEST(RefinedTriangles, AreOfSoManyInstancesThatTheirPartsFitIntoMemory) {
  Scene scene;
  const std::uint32_t used = test::add_material(scene, test::diffuse());
  const std::uint32_t mesh = test::add_mesh(scene, test::quad({-1, 0, -1}, {0, 0, 2}, {2, 0, 0}, used));
  for (int i = 0; i < 1000; ++i) {
    test::place_mesh(scene, mesh, glm::rotate(glm::dmat4(1.0), 0.001 * i, glm::dvec3(1, 0, 0)));
  }
  finish_scene(scene);
  std::size_t parts = 0;
  const std::vector<std::uint8_t> are_refined = refined(scene);
  for (std::size_t i = 0; i < are_refined.size(); ++i) {
    if (are_refined[i] == 0) continue;
    parts += refine(scene, scene.instances[i], {0, 2}, RaySpace(scene)).parts.size();
  }
  EXPECT_GT(parts, 100000U);
  EXPECT_LE(parts, std::size_t{1} << 18);
}

TEST(RefinedTriangles, AreShorterThanTheirDistanceAndClosed) {
  const Scene scene = ground(1e6, tilted());
  const RaySpace space(scene);
  const RefinedTriangles all = refine(scene, scene.instances[0], {0, 2}, space);
  ASSERT_EQ(all.parts.size(), all.triangle_of.size());
  EXPECT_LT(all.parts.size(), 8000U);
  using Point = std::tuple<double, double, double>;
  std::map<std::pair<Point, Point>, int> uses;
  std::array<double, 2> areas{};
  for (std::size_t i = 0; i < all.parts.size(); ++i) {
    const auto& part = all.parts[i];
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::dvec3& a = part.at(k);
      const glm::dvec3& b = part.at((k + 1) % 3);
      EXPECT_LE(glm::distance(a, b), std::max(1.001 * std::max(glm::length(a), glm::length(b)), 0x1p-24));
      ++uses[std::minmax(Point(a.x, a.y, a.z), Point(b.x, b.y, b.z))];
    }
    areas.at(all.triangle_of[i]) += 0.5 * glm::length(glm::cross(part[1] - part[0], part[2] - part[0]));
  }
  const double half = 1e6 * space.scale;
  for (const double area : areas) EXPECT_NEAR(area, 2.0 * half * half, 1e-9);
  for (const auto& [edge, count] : uses) {
    const auto& [a, b] = edge;
    const glm::dvec3 midpoint(0.5 * (std::get<0>(a) + std::get<0>(b)), 0.5 * (std::get<1>(a) + std::get<1>(b)),
                              0.5 * (std::get<2>(a) + std::get<2>(b)));
    const glm::dvec3 flat(glm::inverse(tilted()) * glm::dvec4(midpoint, 1.0));
    const bool on_rim = std::max(std::abs(flat.x), std::abs(flat.z)) > half * (1.0 - 1e-9);
    EXPECT_EQ(count, on_rim ? 1 : 2) << flat.x << ' ' << flat.z;
  }
}

/// Places on the ground from a centimetre to most of its size away from the midpoint.
glm::dvec3 location(Sampler& sampler, double half_size) {
  const double distance = 0.01 * std::pow(70.0 * half_size, sampler.one());
  const double angle = 6.283185307179586 * sampler.one();
  return {distance * std::cos(angle), 0.0, distance * std::sin(angle)};
}

TEST(RefinedTriangles, AreMetFromAboveAndLeftByRays) {
  constexpr double kHalfSize = 1e6;
  const Scene scene = ground(kHalfSize, tilted());
  const RaySpace space(scene);
  const RayScene rays(scene, space, 1);
  const Surfaces surfaces(scene, space);
  RayBatch down;
  RayBatch away;
  RayBatch up;  // to the small square
  constexpr std::size_t kRays = 20000;
  for (std::uint32_t i = 0; i < kRays; ++i) {
    Sampler sampler(3, i);
    const glm::dvec3 flat = location(sampler, kHalfSize);
    const auto in_world = [&](const glm::dvec3& at, double w) { return glm::dvec3(tilted() * glm::dvec4(at, w)); };
    const glm::dvec3 normal = in_world({0, 1, 0}, 0.0);
    WorldTriangle triangle;
    surfaces.load(flat.z > flat.x ? 0 : 1, triangle);
    const SurfacePoint point = surfaces.meet(triangle, in_world(flat, 1.0) + normal, -normal);
    EXPECT_LT(point.offset, 1e-4 * std::max(glm::length(flat), 1.0));
    glm::dvec3 direction = warp::on_sphere(sampler.two());
    if (glm::dot(direction, normal) < 0.0) direction = -direction;
    away.push(space.from_world(ray_origin(point, direction)), direction, HUGE_VAL);
    // From as far above as the place is away, so that the ray's own origin is as exact.
    const double height = 0.5 * std::max(glm::length(flat), 1e-2);
    down.push(space.from_world(in_world(flat, 1.0) + height * normal), -normal, HUGE_VAL);
    const glm::dvec3 under = in_world({0.4 * flat.x / kHalfSize, 0.0, 0.4 * flat.z / kHalfSize}, 1.0);
    const SurfacePoint covered = surfaces.meet(triangle, under + normal, -normal);
    up.push(space.from_world(ray_origin(covered, normal)), normal, HUGE_VAL);
  }
  std::vector<std::uint32_t> met(kRays);
  EXPECT_EQ(rays.closest(down, met), 0U);
  EXPECT_EQ(std::ranges::count_if(met, [](std::uint32_t surface) { return surface > 3; }), 0) << "no cracks";
  EXPECT_GT(std::ranges::count_if(met, [](std::uint32_t surface) { return surface < 2; }), kRays / 2);
  EXPECT_EQ(rays.closest(away, met), 0U);
  EXPECT_EQ(std::ranges::count_if(met, [](std::uint32_t surface) { return surface < 2; }), 0) << "none meets itself";
  EXPECT_EQ(rays.closest(up, met), 0U);
  EXPECT_EQ(std::ranges::count_if(met, [](std::uint32_t surface) { return surface != 2 && surface != 3; }), 0);
}

}  // namespace
}  // namespace hpr
