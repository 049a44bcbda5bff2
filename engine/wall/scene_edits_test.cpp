#include "engine/wall/scene_edits.h"

#include <gtest/gtest.h>

#include "core/error.h"

namespace hpr {
namespace {

Mesh triangle() {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.normals.assign(3, {0, 0, 1});
  mesh.triangles = {{0, 1, 2}};
  return mesh;
}

/// Two nodes of which the first has two meshes, and two lights of which one has no name.
Scene two_nodes() {
  Scene scene;
  scene.meshes = {triangle(), triangle()};
  scene.instances.resize(3);
  scene.instances[1].mesh = 1;
  scene.instances[2].to_world[3] = {5, 0, 0, 1};
  scene.node_names = {"chair", "chair", "table"};
  scene.lights.resize(2);
  scene.lights[0].name = "lamp";
  finish_scene(scene);
  return scene;
}

TEST(SceneEdits, NothingDoneIsTheSceneAsLoaded) {
  Scene scene = two_nodes();
  const std::uint64_t before = content_hash(scene);
  SceneEdits(scene).apply(scene);
  scene.lights[1].name.clear();  // it was given a name to be called by
  EXPECT_EQ(content_hash(scene), before);
}

TEST(SceneEdits, NodesMoveWithAllTheirMeshes) {
  Scene scene = two_nodes();
  SceneEdits edits(scene);
  edits.move_by("chair", {1, 2, 3});
  edits.move_to("table", {0.1, 0.2, 0.3});
  edits.apply(scene);
  EXPECT_EQ(glm::dvec3(scene.instances[0].to_world[3]), glm::dvec3(1, 2, 3));
  EXPECT_EQ(glm::dvec3(scene.instances[1].to_world[3]), glm::dvec3(1, 2, 3));
  EXPECT_EQ(glm::dvec3(scene.instances[2].to_world[3]), glm::dvec3(0.1, 0.2, 0.3));
  EXPECT_EQ(scene.bounds.high, glm::dvec3(2, 3, 3));
}

TEST(SceneEdits, TurnsAboutTheNodesOwnPosition) {
  Scene scene = two_nodes();
  SceneEdits edits(scene);
  edits.turn("table", {0, 0, 2}, 90.0);
  edits.apply(scene);
  const glm::dvec3 corner = world_position(scene.instances[2], {1, 0, 0});
  EXPECT_NEAR(corner.x, 5.0, 1e-15);
  EXPECT_NEAR(corner.y, 1.0, 1e-15);
}

TEST(SceneEdits, HiddenNodesLeaveNoSurfacesAndComeBackAsTheyWere) {
  Scene scene = two_nodes();
  const std::uint64_t surfaces = scene.triangles;
  SceneEdits edits(scene);
  edits.hide("chair", true);
  edits.apply(scene);
  EXPECT_EQ(scene.triangles, surfaces - 2);
  EXPECT_EQ(scene.instances.front().first_surface, 0U);
  EXPECT_EQ(scene.node_names, std::vector<std::string>{"table"});
  edits.hide("chair", false);
  edits.apply(scene);
  EXPECT_EQ(scene.triangles, surfaces);
  EXPECT_EQ(scene.node_names, two_nodes().node_names);
}

TEST(SceneEdits, LightsAreChangedAndPutOut) {
  Scene scene = two_nodes();
  SceneEdits edits(scene);
  edits.light("lamp").light.intensity = {7, 8, 9};
  edits.light("light1").on = false;
  edits.apply(scene);
  ASSERT_EQ(scene.lights.size(), 1U);
  EXPECT_EQ(scene.lights[0].intensity, glm::vec3(7, 8, 9));
}

TEST(SceneEdits, UnknownNamesNameTheNearest) {
  SceneEdits edits(two_nodes());
  try {
    edits.hide("chiar", true);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Usage);
    EXPECT_NE(error.hint().find("did you mean 'chair'?"), std::string::npos) << error.hint();
  }
  EXPECT_THROW((void)edits.light("moon"), Error);
}

TEST(SceneEdits, WhatCannotBeDoneLeavesTheNodeWhereItIs) {
  SceneEdits edits(two_nodes());
  EXPECT_THROW(edits.move_by("chair", {1e19, 0, 0}), Error);
  EXPECT_THROW(edits.turn("chair", {0, 0, 0}, 90.0), Error);
  EXPECT_EQ(edits.position(edits.nodes()[0]), glm::dvec3(0.0));
}

}  // namespace
}  // namespace hpr
