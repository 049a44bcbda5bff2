#include "scene/partial_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "scene/generators/generators.h"
#include "scene/scene.h"

namespace hpr {
namespace {

/// A strip of triangles that partial vertices, with all arrays a mesh may have.
Mesh strip_of(std::uint32_t triangles) {
  Mesh mesh;
  mesh.name = "strip";
  for (std::uint32_t i = 0; i < triangles + 2; ++i) {
    const auto x = static_cast<float>(i);
    mesh.positions.emplace_back(x, static_cast<float>(i % 2), 0.25F * x);
    mesh.normals.emplace_back(0.0F, 0.0F, 1.0F);
    mesh.uvs[0].emplace_back(x, 0.0F);
    mesh.uvs[1].emplace_back(0.0F, x);
    mesh.colors.emplace_back(x / 1000.0F);
    mesh.tangents.emplace_back(1.0F, 0.0F, 0.0F, 1.0F);
  }
  mesh.positions.emplace_back(1e6F, 0.0F, 0.0F);  // no triangle uses it
  mesh.normals.emplace_back(0.0F, 0.0F, 1.0F);
  for (auto& uvs : mesh.uvs) uvs.emplace_back(0.0F);
  mesh.colors.emplace_back(1.0F);
  mesh.tangents.emplace_back(1.0F, 0.0F, 0.0F, 1.0F);
  for (std::uint32_t t = 0; t < triangles; ++t) mesh.triangles.emplace_back(t, t + 1 + t % 2, t + 2 - t % 2);
  return mesh;
}

TEST(PartialMesh, AMeshWithoutTrianglesKnowsWhatItHad) {
  const Mesh whole = strip_of(1200);
  const Mesh known = without_triangles(whole);
  EXPECT_TRUE(known.triangles.empty());
  EXPECT_EQ(memory_of(known), 0U);
  EXPECT_EQ(known.triangle_count(), 1200U);
  EXPECT_EQ(mesh_bounds(known).low, mesh_bounds(whole).low);
  EXPECT_EQ(mesh_bounds(known).high, mesh_bounds(whole).high);
  EXPECT_EQ(longest_edge(known), longest_edge(whole));
  EXPECT_EQ(known.partial->reach.x, 1e6);
  EXPECT_EQ(known.partial->bytes, memory_of(whole));
  EXPECT_EQ(content_hash(known), content_hash(whole));
  ASSERT_EQ(known.partial->chunks.size(), 3U);
  EXPECT_EQ(known.partial->chunks[1].low.x, 512.0);
  EXPECT_EQ(known.partial->chunks[2].high.x, 1201.0);
  EXPECT_FALSE(known.holds(0));
}

TEST(PartialMesh, AnyEdgeMayBeTheLongest) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {3, 0, 0}, {0, 4, 0}};
  mesh.normals.assign(3, {0, 0, 1});
  for (const glm::uvec3 corners : {glm::uvec3(0, 1, 2), glm::uvec3(1, 2, 0), glm::uvec3(2, 0, 1)}) {
    mesh.triangles = {corners};
    EXPECT_EQ(longest_edge(mesh), 5.0);
    EXPECT_EQ(longest_edge(without_triangles(mesh)), 5.0);
  }
}

TEST(PartialMesh, APartHasItsTrianglesByTheirNumbersInTheWhole) {
  const Mesh whole = strip_of(1200);
  const Mesh known = without_triangles(whole);
  const std::array<SurfaceRange, 2> ranges{{{100, 103}, {700, 1200}}};
  const Mesh part = part_of_mesh(whole, ranges, *known.partial);
  EXPECT_EQ(part.triangle_count(), 1200U);
  EXPECT_EQ(part.triangles.size(), 503U);
  EXPECT_EQ(part.positions.size(), 5U + 502U);
  for (std::uint32_t t = 0; t < 1200; ++t) {
    const bool is_here = (t >= 100 && t < 103) || t >= 700;
    ASSERT_EQ(part.holds(t), is_here) << t;
    if (!is_here) continue;
    for (int corner = 0; corner < 3; ++corner) {
      const std::uint32_t a = part.triangle(t)[corner];
      const std::uint32_t b = whole.triangles[t][corner];
      ASSERT_EQ(part.positions[a], whole.positions[b]);
      ASSERT_EQ(part.normals[a], whole.normals[b]);
      ASSERT_EQ(part.uvs[0][a], whole.uvs[0][b]);
      ASSERT_EQ(part.uvs[1][a], whole.uvs[1][b]);
      ASSERT_EQ(part.colors[a], whole.colors[b]);
      ASSERT_EQ(part.tangents[a], whole.tangents[b]);
    }
  }
}

TEST(PartialMesh, APartSurvivesTheWayToAnotherRank) {
  const Mesh whole = strip_of(600);
  const std::array<SurfaceRange, 1> ranges{{{512, 600}}};
  const Mesh part = part_of_mesh(whole, ranges, *without_triangles(whole).partial);
  ByteBuffer buffer;
  append_bytes(part, buffer);
  const Mesh sent = mesh_from_bytes(buffer.bytes());
  EXPECT_EQ(sent.triangle_count(), 600U);
  EXPECT_EQ(sent.triangles, part.triangles);
  EXPECT_EQ(sent.partial->runs, part.partial->runs);
  EXPECT_EQ(content_hash(sent), content_hash(whole));
}

TEST(PartialMesh, TheSceneHasTheSameHashSharedOutOrNot) {
  Scene scene = generate_scene("gallery?s=1&n=2&k=1");
  const std::uint64_t whole = content_hash(scene);
  const std::uint64_t bytes = memory_of(scene);
  std::size_t left_out = 0;
  for (Mesh& mesh : scene.meshes) {
    if (is_held_by_all(scene, mesh)) continue;
    mesh = without_triangles(mesh);
    ++left_out;
  }
  EXPECT_GT(left_out, 0U);
  EXPECT_TRUE(is_shared_out(scene));
  EXPECT_EQ(content_hash(scene), whole);
  EXPECT_LT(memory_of(scene), bytes);
  EXPECT_EQ(whole_memory_of(scene), bytes);
}

TEST(PartialMesh, WhatRanksNeedWholeIsHeldByAll) {
  Scene scene;
  scene.materials.resize(5);
  scene.materials[1].emissive = glm::vec3(1.0F);
  scene.materials[2].alpha_mode = AlphaMode::Blend;
  scene.materials[3].thickness = 0.1F;
  scene.materials[4].alpha_mode = AlphaMode::Mask;
  Mesh mesh = strip_of(1);
  const auto held_with = [&](std::uint32_t material) {
    mesh.material = material;
    return is_held_by_all(scene, mesh);
  };
  EXPECT_FALSE(held_with(0));
  EXPECT_TRUE(held_with(1));
  EXPECT_TRUE(held_with(2));
  EXPECT_TRUE(held_with(3));
  EXPECT_FALSE(held_with(4));
  EXPECT_FALSE(held_with(5));  // the default material, which loaders add last
  mesh.kind = MeshKind::Points;
  EXPECT_TRUE(held_with(0));
}

}  // namespace
}  // namespace hpr
