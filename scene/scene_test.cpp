#include "scene/scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "core/error.h"

namespace hpr {
namespace {

/// A mesh of `count` copies of one triangle with corners (0,0,0), (1,0,0), (0,2,0).
Mesh triangles(std::uint32_t count) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {1e30F, 1e30F, 1e30F}};  // the last one is not used
  mesh.normals.assign(4, {0, 0, 1});
  mesh.triangles.assign(count, {0, 1, 2});
  return mesh;
}

Instance placed(std::uint32_t mesh, const glm::dvec3& at = glm::dvec3(0.0)) {
  Instance instance{.mesh = mesh, .to_world = glm::dmat4(1.0), .first_surface = 99};
  instance.to_world[3] = glm::dvec4(at, 1.0);
  return instance;
}

TEST(FinishScene, NumbersSurfacesInstanceAfterInstance) {
  Scene scene;
  scene.meshes = {triangles(3), triangles(0), triangles(2)};
  scene.instances = {placed(1), placed(0), placed(1), placed(1), placed(2), placed(0), placed(1)};
  finish_scene(scene);
  EXPECT_EQ(scene.triangles, 8U);
  const std::vector<std::uint32_t> expected{0, 0, 3, 3, 3, 5, 8};
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_EQ(scene.instances[i].first_surface, expected[i]) << i;
  EXPECT_EQ(scene.materials.size(), 1U) << "a scene without materials gets a default one";
}

TEST(FinishScene, CalledAgainChangesNothing) {
  Scene scene;
  scene.meshes = {triangles(3)};
  scene.instances = {placed(0), placed(0, {5, 0, 0})};
  finish_scene(scene);
  const std::uint64_t hash = content_hash(scene);
  finish_scene(scene);
  EXPECT_EQ(content_hash(scene), hash);
}

TEST(FinishScene, BoundsHoldUsedVerticesOfDrawnInstancesOnly) {
  Scene scene;
  scene.meshes = {triangles(1), triangles(0)};
  scene.instances = {placed(0, {10, 20, 30}), placed(1, {-500, 0, 0}), placed(0, {-1, 0, 0})};
  finish_scene(scene);
  EXPECT_EQ(scene.bounds.low, glm::dvec3(-1, 0, 0));
  EXPECT_EQ(scene.bounds.high, glm::dvec3(11, 22, 30));
}

TEST(FinishScene, BoundsHoldRotatedInstances) {
  Scene scene;
  scene.meshes = {triangles(1)};
  scene.instances = {placed(0)};
  scene.instances[0].to_world[0] = {0, 0, -3, 0};  // x -> -3 z
  scene.instances[0].to_world[1] = {0, -1, 0, 0};  // y -> -y
  scene.instances[0].to_world[2] = {1, 0, 0, 0};
  finish_scene(scene);
  EXPECT_EQ(scene.bounds.low, glm::dvec3(0, -2, -3));
  EXPECT_EQ(scene.bounds.high, glm::dvec3(0, 0, 0));
}

TEST(FinishScene, AnEmptySceneHasNoTrianglesAndZeroBounds) {
  Scene scene;
  finish_scene(scene);
  EXPECT_EQ(scene.triangles, 0U);
  EXPECT_EQ(scene.bounds.low, glm::dvec3(0.0));
  EXPECT_EQ(scene.bounds.high, glm::dvec3(0.0));
  EXPECT_EQ(scene.materials.size(), 1U);
}

TEST(FinishScene, RefusesMoreTrianglesThanSurfaceIds) {
  Scene scene;
  scene.meshes = {triangles(1U << 20U)};
  scene.instances.assign(4095, placed(0));
  finish_scene(scene);
  EXPECT_EQ(scene.triangles, 4095U << 20U);
  scene.instances.push_back(placed(0));
  try {
    finish_scene(scene);
    FAIL() << "2^32 triangles have no ids";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Limit);
  }
}

TEST(FinishSceneDeathTest, AnInstanceOfNoMeshBreaksTheContract) {
  Scene scene;
  scene.instances = {placed(0)};
  EXPECT_DEATH(finish_scene(scene), "broken contract");
}

TEST(LocateSurface, FindsInstanceAndTriangleAmongEmptyInstances) {
  Scene scene;
  scene.meshes = {triangles(3), triangles(0), triangles(2)};
  scene.instances = {placed(1), placed(0), placed(1), placed(1), placed(2), placed(0), placed(1)};
  finish_scene(scene);
  const std::vector<std::pair<std::uint32_t, std::uint32_t>> expected{{1, 0}, {1, 1}, {1, 2}, {4, 0},
                                                                      {4, 1}, {5, 0}, {5, 1}, {5, 2}};
  for (std::uint32_t surface = 0; surface < scene.triangles; ++surface) {
    const SurfaceLocation location = locate_surface(scene, surface);
    EXPECT_EQ(std::pair(location.instance, location.triangle), expected[surface]) << surface;
  }
  EXPECT_DEATH((void)locate_surface(scene, scene.triangles), "broken contract");
}

TEST(WorldPosition, IsComputedInDouble) {
  const glm::dvec3 at = world_position(placed(0, {1e8, -1e8, 0.125}), {0.25F, 0.5F, 0.0F});
  EXPECT_EQ(at, glm::dvec3(100000000.25, -99999999.5, 0.125));
}

TEST(SmoothNormals, AFlatTriangleHasItsOwnNormal) {
  const auto normals = smooth_normals({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
  for (const glm::vec3& normal : normals) EXPECT_EQ(normal, glm::vec3(0, 0, 1));
}

TEST(SmoothNormals, AreWeightedByArea) {
  // Two triangles share the edge 0-1: one of area 1/2 facing +z, one of area 3/2 facing -y.
  const auto normals = smooth_normals({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 3}}, {{0, 1, 2}, {0, 1, 3}});
  const glm::vec3 mixed = glm::normalize(glm::vec3(0, -3, 1));
  EXPECT_NEAR(glm::distance(normals[0], mixed), 0.0F, 1e-6F);
  EXPECT_NEAR(glm::distance(normals[1], mixed), 0.0F, 1e-6F);
  EXPECT_EQ(normals[2], glm::vec3(0, 0, 1));
  EXPECT_EQ(normals[3], glm::vec3(0, -1, 0));
}

TEST(SmoothNormals, AreUnitLengthAtEveryScale) {
  for (const float scale : {1e-38F, 1e-20F, 1.0F, 1e20F, 1e38F}) {
    for (const glm::vec3& normal :
         smooth_normals({{0, 0, 0}, {scale, 0, 0}, {0, scale, scale}, {0, scale, 0}}, {{0, 1, 2}, {0, 1, 3}})) {
      EXPECT_NEAR(glm::length(normal), 1.0F, 1e-6F) << scale;
    }
  }
}

TEST(SmoothNormals, WithoutAnyAreaPointAlongZ) {
  const auto normals = smooth_normals({{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {7, 7, 7}}, {{0, 1, 2}, {1, 1, 1}});
  for (const glm::vec3& normal : normals) EXPECT_EQ(normal, glm::vec3(0, 0, 1));
  EXPECT_TRUE(smooth_normals({}, {}).empty());
}

}  // namespace
}  // namespace hpr
