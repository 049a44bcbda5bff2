#include "rt/trace/surfaces.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <random>

#include "rt/test_scene.h"
#include "rt/trace/ray_scene.h"

namespace hpr {
namespace {

Scene one_triangle(const glm::dmat4& to_world = glm::dmat4(1.0)) {
  Scene scene;
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {2, 0, 0}, {0, 4, 0}};
  mesh.uvs[0] = {{0, 0}, {1, 0}, {0, 1}};
  mesh.triangles = {{0, 1, 2}};
  test::place_mesh(scene, test::add_mesh(scene, mesh), to_world);
  finish_scene(scene);
  return scene;
}

SurfacePoint meet(const Scene& scene, std::uint32_t id, const glm::dvec3& origin, const glm::dvec3& direction) {
  const Surfaces surfaces(scene, RaySpace(scene));
  WorldTriangle triangle;
  surfaces.load(id, triangle);
  return surfaces.meet(triangle, origin, direction);
}

TEST(Surfaces, ReconstructWhereARayMeetsAKnownTriangle) {
  const SurfacePoint point = meet(one_triangle(), 0, {0.5, 1.0, 3.0}, {0.0, 0.0, -2.0});
  EXPECT_EQ(point.position, glm::dvec3(0.5, 1.0, 0.0));
  EXPECT_EQ(point.uv[0], glm::vec2(0.25F, 0.25F));
  EXPECT_EQ(point.geometric_normal, glm::dvec3(0.0, 0.0, 1.0));
  EXPECT_EQ(point.shading_normal, glm::dvec3(0.0, 0.0, 1.0));
  EXPECT_EQ(point.to_viewer, glm::dvec3(0.0, 0.0, 1.0));
  EXPECT_EQ(point.lift, glm::dvec3(0.0));
}

TEST(Surfaces, TurnNormalsToTheViewersSide) {
  const SurfacePoint point = meet(one_triangle(), 0, {0.5, 1.0, -3.0}, {0.0, 0.0, 1.0});
  EXPECT_EQ(point.geometric_normal, glm::dvec3(0.0, 0.0, -1.0));
  EXPECT_EQ(point.shading_normal, glm::dvec3(0.0, 0.0, -1.0));
}

TEST(Surfaces, ShadeByTheGeometricNormalWhereTheSmoothOneTurnsAway) {
  Scene scene = one_triangle();
  scene.meshes[0].normals.assign(3, glm::normalize(glm::vec3(1.0F, 0.0F, 1.0F)));
  const SurfacePoint from_right = meet(scene, 0, {3.5, 1.0, 1.0}, {-3.0, 0.0, -1.0});
  EXPECT_EQ(from_right.facing_normal(), from_right.shading_normal);
  const SurfacePoint from_left = meet(scene, 0, {-2.5, 1.0, 1.0}, {3.0, 0.0, -1.0});
  EXPECT_GT(glm::dot(from_left.shading_normal, glm::dvec3(0.0, 0.0, 1.0)), 0.7);
  EXPECT_EQ(from_left.facing_normal(), glm::dvec3(0.0, 0.0, 1.0));
}

TEST(Surfaces, LeaveMoreRoomWhereARayIsCarriedIntoADistortedMesh) {
  Scene scene = one_triangle();
  const double plain = meet(scene, 0, {0.5, 1.0, 3.0}, {0.0, 0.0, -1.0}).offset;
  EXPECT_GT(plain, 0.0);
  // Two instances share the mesh. What rounds along x in the coordinates of the second is carried along z.
  glm::dmat4 sheared(1.0);
  sheared[0][2] = 1.0;
  test::place_mesh(scene, 0, sheared);
  finish_scene(scene);
  const SurfacePoint point = meet(scene, 1, {0.5, 1.0, 3.0}, {0.0, 0.0, -1.0});
  EXPECT_GE(point.offset, kOriginSteps * kFloatStep * 4.0);
  EXPECT_GT(point.offset, 2.0 * plain);
}

/// The offset at a place of a square ground of half that size, turned about an axis of the ground.
double offset_on_ground(double half_size, const glm::dvec3& at, double tilt) {
  Scene scene;
  const auto size = static_cast<float>(half_size);
  const Mesh ground = test::quad({-size, 0, -size}, {0, 0, 2 * size}, {2 * size, 0, 0}, test::add_material(scene, {}));
  const glm::dmat4 turned = glm::rotate(glm::dmat4(1.0), tilt, glm::dvec3(0.0, 0.0, 1.0));
  test::place_mesh(scene, test::add_mesh(scene, ground), turned);
  finish_scene(scene);
  const glm::dvec3 position(turned * glm::dvec4(at, 1.0));
  const glm::dvec3 up(turned * glm::dvec4(0.0, 1.0, 0.0, 0.0));
  return meet(scene, 0, position + up, -up).offset;
}

TEST(Surfaces, LeaveRoomByThePlaceOnALevelGroundHoweverWideItIs) {
  for (const double half_size : {10.0, 1e3, 1e6, 1e9}) {
    EXPECT_LT(offset_on_ground(half_size, {2.0, 0.0, 1.0}, 0.0), 2e-3) << half_size;
    EXPECT_GT(offset_on_ground(half_size, {2.0, 0.0, 1.0}, 0.0), 1e-7) << half_size;
    EXPECT_GT(offset_on_ground(half_size, {0.0, 0.0, 0.0}, 0.0), 0.0) << half_size;
    // Floats do not hold what is tilted so exactly, but in parts.
    EXPECT_LT(offset_on_ground(half_size, {2.0, 0.0, 1.0}, 0.3), 2e-3) << half_size;
    EXPECT_GT(offset_on_ground(half_size, {2.0, 0.0, 1.0}, 0.3), 1e-6) << half_size;
  }
}

TEST(Surfaces, KeepThePointOnTheTriangleWhenTheRayPassesBeside) {
  Scene scene = one_triangle();
  test::place_mesh(scene, 0, glm::translate(glm::dmat4(1.0), {0.0, 0.0, -4.0}));
  finish_scene(scene);
  EXPECT_EQ(meet(scene, 0, {-1.0, 2.0, 1.0}, {0.0, 0.0, -1.0}).position, glm::dvec3(0.0, 2.0, 0.0));
  const SurfacePoint past = meet(scene, 0, {2.0, 4.0, 1.0}, {0.0, 0.0, -1.0});
  EXPECT_NEAR(past.position.x / 2.0 + past.position.y / 4.0, 1.0, 1e-15);
  const SurfacePoint edge_on = meet(scene, 0, {-1.0, 1.0, 0.0}, {1.0, 0.0, 0.0});
  EXPECT_TRUE(std::isfinite(edge_on.position.x) && edge_on.position.z == 0.0);
}

TEST(Surfaces, KeepThePointOnAWideTriangleButForRounding) {
  const Scene scene = one_triangle();  // alone, it is as wide as all of its scene
  const glm::dvec3 aside = meet(scene, 0, {-1.0, 2.0, 1.0}, {0.0, 0.0, -1.0}).position;
  EXPECT_LT(glm::distance(aside, glm::dvec3(0.0, 2.0, 0.0)), 3e-5);
  const SurfacePoint past = meet(scene, 0, {2.0, 4.0, 1.0}, {0.0, 0.0, -1.0});
  EXPECT_NEAR(past.position.x / 2.0 + past.position.y / 4.0, 1.0, 3e-5);
  const SurfacePoint edge_on = meet(scene, 0, {-1.0, 1.0, 0.0}, {1.0, 0.0, 0.0});
  EXPECT_TRUE(std::isfinite(edge_on.position.x) && edge_on.position.z == 0.0);
}

TEST(Surfaces, AreExactFarFromTheOrigin) {
  const glm::dvec3 far(1e7, -3e6, 2e7);
  const Scene scene = one_triangle(glm::translate(glm::dmat4(1.0), far));
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0.0, 0.9);
  for (int i = 0; i < 200; ++i) {
    const glm::dvec3 target = far + glm::dvec3(uniform(random), uniform(random), 0.0);
    const glm::dvec3 eye = far + glm::dvec3(5.0 * uniform(random), 3.0, 100.0);
    EXPECT_LT(glm::length(meet(scene, 0, eye, target - eye).position - target), 2e-8);
  }
}

TEST(Surfaces, TransformNormalsByTheInverseTransposeAndUnderMirroring) {
  // A slope of 45 degrees squashed to half its height: the normal gets steeper, not flatter.
  Scene scene;
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 1, 0}, {0, 0, -1}};
  mesh.triangles = {{0, 1, 2}};
  const std::uint32_t id = test::add_mesh(scene, mesh);
  test::place_mesh(scene, id, glm::scale(glm::dmat4(1.0), {1.0, 0.5, 1.0}));
  test::place_mesh(scene, id, glm::scale(glm::dmat4(1.0), {1.0, -0.5, 1.0}));
  test::place_mesh(scene, id, glm::scale(glm::dmat4(1.0), {1.0, 0.0, 1.0}));
  finish_scene(scene);
  const glm::dvec3 up = glm::normalize(glm::dvec3(-0.5, 1.0, 0.0));
  EXPECT_LT(glm::length(meet(scene, 0, {0.4, 5, -0.2}, {0, -1, 0}).shading_normal - up), 1e-7);
  const glm::dvec3 reflected = glm::normalize(glm::dvec3(0.5, 1.0, 0.0));
  EXPECT_LT(glm::length(meet(scene, 1, {0.4, 5, -0.2}, {0, -1, 0}).shading_normal - reflected), 1e-7);
  EXPECT_LT(glm::length(meet(scene, 2, {0.4, 5, -0.2}, {0, -1, 0}).shading_normal - glm::dvec3(0, 1, 0)), 1e-7);
}

TEST(Surfaces, KnowWhichSideOfAFaceTheViewerIsOn) {
  const glm::dmat4 mirror = glm::scale(glm::dmat4(1.0), {-1.0, 1.0, 1.0});
  for (const double size : {1.0, 1e-120, 1e15}) {
    const glm::dmat4 scale = glm::scale(glm::dmat4(1.0), glm::dvec3(size));
    const auto inside = [&](const glm::dmat4& to_world, double x, double z) {
      return meet(one_triangle(scale * to_world), 0, size * glm::dvec3(x, 1.0, z), {0.0, 0.0, -z}).inside;
    };
    EXPECT_FALSE(inside(glm::dmat4(1.0), 0.5, 3.0)) << size;
    EXPECT_TRUE(inside(glm::dmat4(1.0), 0.5, -3.0)) << size;
    // Mirroring turns windings round, not the front of a thing.
    EXPECT_FALSE(inside(mirror, -0.5, 3.0)) << size;
    EXPECT_TRUE(inside(mirror, -0.5, -3.0)) << size;
  }
}

TEST(Surfaces, HaveThePlaneOfWhereARayMeetsThem) {
  const Scene scene = one_triangle(glm::rotate(glm::dmat4(1.0), 0.7, glm::dvec3(1.0, 2.0, 3.0)));
  const Surfaces surfaces(scene, RaySpace(scene));
  WorldTriangle triangle;
  surfaces.load(0, triangle);
  for (const double side : {-3.0, 3.0}) {
    const glm::dvec3 inside = triangle.v0 + 0.25 * triangle.e1 + 0.25 * triangle.e2;
    const glm::dvec3 origin = inside + side * triangle.normal;
    const SurfacePlane plane = surfaces.plane(triangle, origin, inside - origin);
    const SurfacePoint point = surfaces.meet(triangle, origin, inside - origin);
    EXPECT_EQ(plane.position, point.position);
    EXPECT_EQ(plane.normal, point.geometric_normal);
    EXPECT_EQ(plane.tolerance, surfaces.coplanar_tolerance(triangle, point.offset));
    EXPECT_GT(plane.tolerance, point.offset);
  }
}

TEST(Surfaces, InterpolateVertexColorsAndTellTheirNumber) {
  Scene scene = one_triangle();
  EXPECT_EQ(meet(scene, 0, {0.5, 1.0, 3.0}, {0.0, 0.0, -2.0}).color, glm::dvec4(1.0));
  EXPECT_EQ(meet(scene, 0, {0.5, 1.0, 3.0}, {0.0, 0.0, -2.0}).surface, 0U);
  scene.meshes[0].colors = {{1, 0, 0, 1}, {0, 1, 0, 0}, {0, 0, 1, 0.5F}};
  EXPECT_EQ(meet(scene, 0, {0.5, 1.0, 3.0}, {0.0, 0.0, -2.0}).color, glm::dvec4(0.5, 0.25, 0.25, 0.625));
  test::place_mesh(scene, 0);
  finish_scene(scene);
  EXPECT_EQ(meet(scene, 1, {0.5, 1.0, 3.0}, {0.0, 0.0, -2.0}).surface, 1U);
}

TEST(Surfaces, FindTheInstanceOfAnyIdInAnyOrder) {
  Scene scene;
  const std::uint32_t square = test::add_mesh(scene, test::quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 0));
  const std::uint32_t empty = test::add_mesh(scene, Mesh{});
  for (int i = 0; i < 4; ++i) {
    test::place_mesh(scene, square, glm::translate(glm::dmat4(1.0), {10.0 * i, 0.0, 0.0}));
    test::place_mesh(scene, empty);
  }
  finish_scene(scene);
  const Surfaces surfaces(scene, RaySpace(scene));
  WorldTriangle triangle;
  for (const std::uint32_t id : {7U, 0U, 1U, 6U, 2U, 3U, 5U, 4U, 4U}) {
    surfaces.load(id, triangle);
    EXPECT_EQ(triangle.v0.x, 10.0 * (id / 2)) << id;
    EXPECT_EQ(triangle.index, id % 2) << id;
  }
}

}  // namespace
}  // namespace hpr
