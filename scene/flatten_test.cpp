#include "scene/flatten.h"

#include <gtest/gtest.h>

#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>

namespace hpr {
namespace {

Scene instances_of_a_triangle(const std::vector<glm::dmat4>& to_world) {
  Scene scene;
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.normals.assign(3, {0, 0, 1});
  mesh.tangents.assign(3, {1, 0, 0, 1});
  mesh.triangles = {{0, 1, 2}};
  scene.meshes.push_back(mesh);
  for (const glm::dmat4& matrix : to_world) scene.instances.push_back({0, matrix, 0});
  finish_scene(scene);
  return scene;
}

TEST(Flatten, EveryInstanceBecomesAMeshInTheWorld) {
  const glm::dmat4 moved = glm::translate(glm::dmat4(1.0), {3.0, 4.0, 5.0});
  const Scene scene = instances_of_a_triangle({glm::dmat4(1.0), moved});
  const Scene flat = flattened(scene);
  ASSERT_EQ(flat.meshes.size(), 2U);
  EXPECT_EQ(flat.triangles, scene.triangles);
  EXPECT_EQ(flat.bounds.low, scene.bounds.low);
  EXPECT_EQ(flat.bounds.high, scene.bounds.high);
  EXPECT_EQ(flat.meshes[1].positions[1], glm::vec3(4, 4, 5));
  EXPECT_EQ(flat.instances[1].to_world, glm::dmat4(1.0));
}

TEST(Flatten, NormalsOfStretchedAndMirroredInstancesStayAtRightAnglesAndOnTheirSide) {
  glm::dmat4 sheared(1.0);
  sheared[0] = {-2.0, 0.0, 1.0, 0.0};  // mirrors, and shears x into z
  const Scene flat = flattened(instances_of_a_triangle({sheared}));
  const Mesh& mesh = flat.meshes[0];
  const glm::uvec3& t = mesh.triangles[0];
  const glm::vec3 by_winding =
      glm::cross(mesh.positions[t.y] - mesh.positions[t.x], mesh.positions[t.z] - mesh.positions[t.x]);
  EXPECT_NEAR(glm::dot(mesh.normals[0], glm::normalize(by_winding)), 1.0F, 1e-6F);
  EXPECT_NEAR(glm::dot(mesh.normals[0], glm::vec3(mesh.tangents[0])), 0.0F, 1e-6F);
  EXPECT_EQ(mesh.tangents[0].w, -1.0F);
}

}  // namespace
}  // namespace hpr
