#include "rt/trace/ray_scene.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <random>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "core/error.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Scene facing_quad() {
  Scene scene;
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0)));
  finish_scene(scene);
  return scene;
}

TEST(RayScene, FindsWhatABruteForceSearchFinds) {
  Scene scene;
  test::place_mesh(scene, test::add_mesh(scene, test::sphere(1.0, 12, 0)),
                   glm::translate(glm::dmat4(1.0), {0.3, 0.1, 0.0}));
  const std::uint32_t shared = test::add_mesh(scene, test::sphere(0.5, 6, 0));
  test::place_mesh(scene, shared, glm::translate(glm::dmat4(1.0), {-1.5, 0.0, 0.0}));
  test::place_mesh(scene, shared, glm::scale(glm::translate(glm::dmat4(1.0), {0.0, 1.4, 0.2}), {0.5, 1.0, -0.7}));
  finish_scene(scene);
  ASSERT_EQ(shared_instances(scene), (std::vector<std::uint8_t>{0, 1, 1}));
  const RaySpace space(scene);
  const RayScene rays(scene, space, 1);
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(-2.0, 2.0);
  RayBatch batch;
  std::vector<Ray> cast;
  for (int i = 0; i < 1003; ++i) {
    const glm::dvec3 origin(uniform(random), uniform(random), 4.0);
    const glm::dvec3 direction = glm::normalize(glm::dvec3(uniform(random), uniform(random), 0.0) - origin);
    cast.push_back({origin, direction});
    batch.push(space.from_world(origin), direction, kInfinity);
  }
  std::vector<std::uint32_t> surfaces(cast.size());
  EXPECT_EQ(rays.closest(batch, surfaces), 0U);
  std::vector<std::uint8_t> blocked(cast.size());
  EXPECT_EQ(rays.occluded(batch, blocked), 0U);
  std::size_t differing = 0;
  const test::Caster caster(scene);
  for (std::size_t i = 0; i < cast.size(); ++i) {
    const test::Met met = caster.cast(cast[i].origin, cast[i].direction);
    const std::uint32_t expected = std::isfinite(met.distance) ? met.surface : kNoSurface;
    if (surfaces[i] != expected) ++differing;
    EXPECT_EQ(blocked[i] != 0, surfaces[i] != kNoSurface);
  }
  EXPECT_LE(differing, 2U);  // rays within a rounding of an edge
}

/// Two spheres of their own triangles, and twenty that share theirs.
Scene spheres() {
  Scene scene;
  for (int i = 0; i < 2; ++i) {
    test::place_mesh(scene, test::add_mesh(scene, test::sphere(1.0, 40, 0)),
                     glm::translate(glm::dmat4(1.0), {0.3, i, 0.0}));
  }
  const std::uint32_t shared = test::add_mesh(scene, test::sphere(0.5, 40, 0));
  for (int i = 0; i < 20; ++i) {
    test::place_mesh(scene, shared, glm::translate(glm::dmat4(1.0), {std::cos(i), 0.1 * i - 1.0, std::sin(i)}));
  }
  finish_scene(scene);
  return scene;
}

/// Whether Embree's memory sufficed. Any other failure than that is a failure of the test.
bool is_built_within(const Scene& scene, std::size_t max_bytes) {
  try {
    const RayScene rays(scene, RaySpace(scene), 2, std::array{SurfaceRange{0, scene.triangles}},
                        {.max_bytes = max_bytes});
    return true;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Limit) << error.what();
    EXPECT_NE(error.hint().find("more ranks"), std::string::npos) << error.hint();
    return false;
  }
}

TEST(RayScene, MemoryThatEndsAnywhereIsALimitAndNotAMissingDevice) {
  const Scene scene = spheres();
  std::size_t bytes = 1;
  int refused = 0;
  for (; !is_built_within(scene, bytes); bytes += 1 + bytes / 8) ++refused;
  EXPECT_GT(refused, 20);
  EXPECT_LT(bytes, std::size_t{1} << 30U);
}

/// Surfaces met by rays from random places, many of them into the edges of triangles.
std::vector<std::uint32_t> met_with(const RayBuild& build) {
  Scene scene;
  test::place_mesh(scene, test::add_mesh(scene, test::sphere(1.0, 40, 0)),
                   glm::translate(glm::dmat4(1.0), {0.3, 0.1, 0.0}));
  const std::uint32_t shared = test::add_mesh(scene, test::sphere(0.5, 12, 0));
  for (int i = 0; i < 20; ++i) {
    test::place_mesh(scene, shared, glm::translate(glm::dmat4(1.0), {std::cos(i), 0.1 * i - 1.0, std::sin(i)}));
  }
  const Mesh quad = test::quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0);
  for (int copy = 0; copy < 3; ++copy) test::place_mesh(scene, test::add_mesh(scene, quad));
  finish_scene(scene);
  const RaySpace space(scene);
  const RayScene rays(scene, space, 1, std::array{SurfaceRange{0, scene.triangles}}, build);
  std::mt19937 random(12);
  std::uniform_real_distribution<double> uniform(-2.0, 2.0);
  const Mesh& mesh = scene.meshes.front();
  RayBatch batch;
  for (int i = 0; i < 20000; ++i) {
    const glm::dvec3 origin(uniform(random), uniform(random), uniform(random));
    const glm::dvec3 anywhere(uniform(random), uniform(random), uniform(random));
    const auto vertex = glm::dvec3(mesh.positions[static_cast<std::size_t>(i) % mesh.positions.size()]);
    const glm::dvec3 aim = i % 2 == 0 ? anywhere : vertex + glm::dvec3(0.3, 0.1, 0.0);
    batch.push(space.from_world(origin), glm::normalize(aim - origin), kInfinity);
  }
  std::vector<std::uint32_t> surfaces(batch.size());
  EXPECT_EQ(rays.closest(batch, surfaces), 0U);
  std::vector<std::uint8_t> blocked(batch.size());
  (void)rays.occluded(batch, blocked);
  for (std::size_t i = 0; i < surfaces.size(); ++i) EXPECT_EQ(blocked[i] != 0, surfaces[i] != kNoSurface) << i;
  return surfaces;
}

TEST(RayScene, MeetsTheSameSurfacesWhateverTheQualityOfItsTrees) {
  const auto expected = met_with({});
  EXPECT_TRUE(met_with({BuildQuality::Low, true}) == expected);
  EXPECT_TRUE(met_with({BuildQuality::High, true}) == expected);
}

/// Quads, level and upright as the walls of rooms, and tilted.
Scene quads(std::mt19937& random) {
  std::uniform_real_distribution<float> uniform(-1.0F, 1.0F);
  const auto random_point = [&] { return glm::vec3(uniform(random), uniform(random), uniform(random)); };
  Scene scene;
  for (int axis = 0; axis < 3; ++axis) {
    for (int i = 0; i < 20; ++i) {
      glm::vec3 a(0.0F);
      glm::vec3 b(0.0F);
      a[(axis + 1) % 3] = 0.3F + 0.2F * uniform(random);
      b[(axis + 2) % 3] = 0.3F + 0.2F * uniform(random);
      test::place_mesh(scene, test::add_mesh(scene, test::quad(random_point(), a, b, 0)));
    }
  }
  for (int i = 0; i < 20; ++i) {
    test::place_mesh(
        scene, test::add_mesh(scene, test::quad(random_point(), 0.3F * random_point(), 0.3F * random_point(), 0)));
  }
  finish_scene(scene);
  return scene;
}

TEST(RayScene, MeetsTheLowerOfTwoTrianglesAtTheirEdgeWhateverItsTreeAndItsParts) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const Scene scene = quads(random);
  const RaySpace space(scene);
  RayBatch batch;
  for (int i = 0; i < 200000; ++i) {
    const auto surface = static_cast<std::uint32_t>(i) % scene.triangles;
    const Instance& instance = scene.instances[surface / 2];
    // On the diagonal, which both triangles of a quad have.
    const Mesh& mesh = scene.mesh_of(instance);
    const glm::dvec3 a = space.from_world(glm::dvec3(mesh.positions[mesh.triangle(0).x]));
    const glm::dvec3 b = space.from_world(glm::dvec3(mesh.positions[mesh.triangle(0).z]));
    const glm::dvec3 goal = a + (0.5 + 0.49 * uniform(random)) * (b - a);
    const glm::dvec3 origin(uniform(random), uniform(random), uniform(random));
    batch.push(origin, glm::normalize(goal - origin), kInfinity);
  }
  const auto met = [&](std::span<const SurfaceRange> objects, BuildQuality quality) {
    const RayScene rays(scene, space, 2, objects, {.quality = quality});
    std::vector<Passed> passed(batch.size());
    std::vector<std::uint32_t> surfaces(batch.size());
    EXPECT_EQ(rays.closest(batch, passed, surfaces), 0U);
    return passed;
  };
  const std::array all{SurfaceRange{0, scene.triangles}};
  const std::vector<Passed> expected = met(all, BuildQuality::Medium);
  const auto differing = [&](const std::vector<Passed>& found) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < found.size(); ++i) count += found[i].surface != expected[i].surface ? 1U : 0U;
    return count;
  };
  EXPECT_EQ(differing(met(all, BuildQuality::Low)), 0U);
  EXPECT_EQ(differing(met(all, BuildQuality::High)), 0U);
  // As two ranks that have every other triangle, the nearer one wins.
  std::array<std::vector<SurfaceRange>, 2> halves;
  for (std::uint32_t i = 0; i < scene.triangles; ++i) halves.at(i % 2).push_back({i, i + 1});
  std::vector<Passed> merged = met(halves[0], BuildQuality::Medium);
  const std::vector<Passed> other = met(halves[1], BuildQuality::Medium);
  for (std::size_t i = 0; i < merged.size(); ++i) {
    const bool is_other = merged[i].surface == kNoSurface ||
                          (other[i].surface != kNoSurface && std::tie(other[i].distance, other[i].surface) <
                                                                 std::tie(merged[i].distance, merged[i].surface));
    if (is_other) merged[i] = other[i];
  }
  EXPECT_EQ(differing(merged), 0U);
}

TEST(RayScene, MeetsTheNearerOfTwoTrianglesThatAreAFewRoundingStepsApart) {
  constexpr float kApart = 4.0F / (1U << 23U);
  Scene scene;
  constexpr int kPairs = 64;
  for (int pair = 0; pair < kPairs; ++pair) {
    // Every other pair has the nearer one, which lies higher, first.
    const auto x = static_cast<float>(pair % 8) / 8.0F - 0.5F;
    const auto y = static_cast<float>(pair / 8) / 8.0F - 0.5F;
    for (const bool first : {true, false}) {
      const float z = first == (pair % 2 == 0) ? kApart : 0.0F;
      test::place_mesh(scene, test::add_mesh(scene, test::quad({x, y, z}, {0.1F, 0, 0}, {0, 0.1F, 0}, 0)));
    }
  }
  finish_scene(scene);
  const RaySpace space(scene.bounds);
  RayBatch batch;
  for (int pair = 0; pair < kPairs; ++pair) {
    const glm::dvec3 above(pair % 8 / 8.0 - 0.47, pair / 8 / 8.0 - 0.44, 1.0);
    batch.push(space.from_world(above), {0.0, 0.0, -1.0}, kInfinity);
  }
  for (const BuildQuality quality : {BuildQuality::Low, BuildQuality::Medium, BuildQuality::High}) {
    const RayScene rays(scene, space, 1, std::array{SurfaceRange{0, scene.triangles}}, {.quality = quality});
    std::vector<Passed> passed(batch.size());
    std::vector<std::uint32_t> surfaces(batch.size());
    EXPECT_EQ(rays.closest(batch, passed, surfaces), 0U);
    for (int pair = 0; pair < kPairs; ++pair) {
      const std::uint32_t mesh = passed[static_cast<std::size_t>(pair)].surface / 2;
      EXPECT_EQ(mesh, static_cast<std::uint32_t>(2 * pair + pair % 2)) << pair;
    }
  }
}

TEST(RayScene, TheWidestInstructionsMayDisagreeAtEdgesAlone) {
  const auto expected = met_with({});
  const auto widest = met_with({BuildQuality::Medium, false});
  std::size_t differing = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) differing += expected[i] != widest[i] ? 1U : 0U;
  EXPECT_LT(differing, expected.size() / 20);  // every other ray is aimed at a vertex, where six triangles meet
}

TEST(RayScene, GivesTheLowestIdAmongSurfacesInOnePlane) {
  Scene scene;
  const Mesh quad = test::quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0);
  for (int copy = 0; copy < 5; ++copy) test::place_mesh(scene, test::add_mesh(scene, quad));
  finish_scene(scene);
  const RaySpace space(scene);
  const RayScene rays(scene, space, 1);
  RayBatch batch;
  for (int i = 0; i < 100; ++i) batch.push({-0.9 + 0.0177 * i, 0.5, 3.0}, {0, 0, -1}, kInfinity);
  std::vector<std::uint32_t> surfaces(batch.size());
  (void)rays.closest(batch, surfaces);
  for (const std::uint32_t surface : surfaces) EXPECT_LT(surface, 2U);
}

TEST(RayScene, SurvivesEveryKindOfImpossibleRayAndCountsThem) {
  const Scene scene = facing_quad();
  const RayScene rays(scene, RaySpace(scene), 1);
  const double nan = std::nan("");
  RayBatch batch;
  batch.push({0, 0, 1}, {0, 0, -1}, kInfinity);  // the only good one
  batch.push({nan, 0, 1}, {0, 0, -1}, kInfinity);
  batch.push({0, 0, 1e30}, {0, 0, -1}, kInfinity);
  batch.push({0, 0, 1e300}, {0, 0, -1}, kInfinity);
  batch.push({0, 0, 1}, {0, nan, -1}, kInfinity);
  batch.push({0, 0, 1}, {0, 0, -1e20}, kInfinity);
  batch.push({0, 0, 1}, {0, 0, 0}, kInfinity);
  batch.push({0, 0, 1}, {0, 0, -1}, nan);
  batch.push({0, 0, 1}, {0, 0, -1}, -1.0);
  std::vector<std::uint32_t> surfaces(batch.size());
  std::vector<std::uint8_t> blocked(batch.size());
  EXPECT_EQ(rays.closest(batch, surfaces), 8U);
  EXPECT_EQ(rays.occluded(batch, blocked), 8U);
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    EXPECT_EQ(surfaces[i] != kNoSurface, i == 0);
    EXPECT_EQ(blocked[i] != 0, i == 0);
  }
}

TEST(RayScene, ARayOfNoReachIsSoundAndMeetsNothing) {
  const Scene scene = facing_quad();
  const RayScene rays(scene, RaySpace(scene), 1);
  RayBatch batch;
  batch.push({0, 0, 1}, {0, 0, -1}, 0.0);  // what a light right on the surface gives
  std::vector<std::uint8_t> blocked(1);
  EXPECT_EQ(rays.occluded(batch, blocked), 0U);
  EXPECT_EQ(blocked[0], 0);
}

TEST(RayScene, BlocksOnlyUpToTheRaysReach) {
  const Scene scene = facing_quad();
  const RayScene rays(scene, RaySpace(scene), 1);
  RayBatch batch;
  batch.push({0.1, 0.2, 1}, {0, 0, -1}, 0.999);
  batch.push({0.1, 0.2, 1}, {0, 0, -1}, 1.001);
  batch.push({0.1, 0.2, 1}, {0, 0, 1}, kInfinity);
  std::vector<std::uint8_t> blocked(3);
  (void)rays.occluded(batch, blocked);
  EXPECT_EQ(blocked, (std::vector<std::uint8_t>{0, 1, 0}));
}

TEST(RayScene, TakesSingularHugeAndEmptyPlacements) {
  Scene scene;
  const std::uint32_t ball = test::add_mesh(scene, test::sphere(1.0, 4, 0));
  const std::uint32_t empty = test::add_mesh(scene, Mesh{});
  test::place_mesh(scene, ball);
  test::place_mesh(scene, ball, glm::scale(glm::dmat4(1.0), {1.0, 0.0, 1.0}));
  test::place_mesh(scene, ball, glm::dmat4(0.0));
  test::place_mesh(scene, ball, glm::scale(glm::dmat4(1.0), {1e-7, 1.0, 1.0}));
  test::place_mesh(scene, empty);
  finish_scene(scene);
  const RaySpace space(scene);
  const RayScene rays(scene, space, 1);
  EXPECT_EQ(rays.skipped_triangles(), 0U);
  RayBatch batch;
  batch.push(space.from_world({0.02, 0.03, 5}), {0, 0, -1}, kInfinity);
  std::vector<std::uint32_t> surfaces(1);
  EXPECT_EQ(rays.closest(batch, surfaces), 0U);
  EXPECT_LT(surfaces[0], scene.instances[1].first_surface);
}

TEST(RayScene, LeavesOutTrianglesBeyondFloatAndKeepsTheNumbersOfTheOthers) {
  Scene scene;
  Mesh mesh = test::quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0);
  mesh.positions.push_back({1e38F, 1e38F, 1e38F});
  mesh.normals.clear();
  mesh.triangles = {{0, 1, 4}, {0, 1, 2}, {0, 2, 3}};
  test::place_mesh(scene, test::add_mesh(scene, mesh));
  finish_scene(scene);
  const RayScene rays(scene, RaySpace(), 1);
  EXPECT_EQ(rays.skipped_triangles(), 1U);
  RayBatch batch;
  batch.push({0.5, 0.1, 1}, {0, 0, -1}, kInfinity);
  std::vector<std::uint32_t> surfaces(1);
  (void)rays.closest(batch, surfaces);
  EXPECT_EQ(surfaces[0], 1U);
}

}  // namespace
}  // namespace hpr
