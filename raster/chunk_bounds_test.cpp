#include "raster/chunk_bounds.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <random>

#include "raster/raster_test_scenes.h"

namespace hpr {
namespace {

using test::uniform;

/// Soup and waves, placed near and far, small, huge, mirrored and flat.
Scene scene_of_instances() {
  Scene scene;
  scene.materials.emplace_back();
  scene.meshes.push_back(test::soup(1500, 3));
  scene.meshes.push_back(test::waves(40));
  for (const double scale : {1.0, 1e-3, 300.0, -1.0}) {
    for (std::uint32_t mesh = 0; mesh < 2; ++mesh) {
      scene.instances.push_back(test::placed(mesh, {0.7 * mesh, -0.3, 0.4 * scale}, 0.3 * scale, scale));
    }
  }
  Instance flat = test::placed(1, {0.5, 0.5, -1.0});
  flat.to_world = flat.to_world * glm::scale(glm::dmat4(1.0), glm::dvec3(1.0, 0.0, 1.0));
  scene.instances.push_back(flat);
  Instance beyond = test::placed(0, {0.0, 0.0, 0.0});
  beyond.to_world[0][0] = 1e35;  // which no float holds: GL draws nothing of it
  scene.instances.push_back(beyond);
  for (Instance& instance : scene.instances) {
    instance.first_surface = scene.triangles;
    scene.triangles += static_cast<std::uint32_t>(scene.mesh_of(instance).triangles.size());
  }
  return scene;
}

View view_from(std::mt19937& random, bool orthographic) {
  View view;
  view.eye = {uniform(random, -2, 2), uniform(random, -2, 2), uniform(random, -1, 3)};
  const double angle = uniform(random, -3, 3);
  view.axes = glm::dmat3(glm::rotate(glm::dmat4(1.0), angle, glm::normalize(glm::dvec3(0.3, 1.0, 0.2))));
  view.left = -0.9;
  view.right = 0.5;
  view.bottom = -0.4;
  view.top = 0.8;
  view.near_distance = random() % 2 == 0 ? 1e-3 : 0.5;
  view.far_distance = 50.0;
  view.orthographic = orthographic;
  view.screen = {333, 250};
  view.block = {0, 0, 333, 250};
  return view;
}

TEST(ChunkBounds, PixelsOfEveryPointBeforeTheNearPlaneLieInsideWhateverTheJitter) {
  const Scene scene = scene_of_instances();
  const std::vector<SceneChunk> chunks = make_scene_chunks(scene, 2).chunks;
  std::mt19937 random(1);
  int inside = 0;
  int tight = 0;
  for (int trial = 0; trial < 24; ++trial) {
    View view = view_from(random, trial % 4 == 3);
    const std::vector<ChunkBounds> bounds = bound_chunks(scene, chunks, view, 2);
    std::vector<Rect> of_chunk(chunks.size());
    for (const ChunkBounds& each : bounds) {
      of_chunk[each.chunk] = each.pixels;
      EXPECT_GE(each.covered, 0.0F);
      EXPECT_LE(each.covered, static_cast<float>(each.pixels.area()));
      tight += each.pixels.area() < view.size().area() / 4 ? 1 : 0;
    }
    for (const double x : {-kMaxJitter, 0.0, kMaxJitter}) {
      view.jitter = {x, -x};
      const glm::dmat4 from_world = clip_from_world(view, view.eye);
      for (std::size_t i = 0; i < chunks.size(); ++i) {
        const Instance& instance = scene.instances[chunks[i].instance];
        if (std::abs(instance.to_world[0][0]) > 1e30) {
          EXPECT_TRUE(of_chunk[i].empty());
          continue;
        }
        const Mesh& mesh = scene.mesh_of(instance);
        for (std::uint32_t s = chunks[i].surfaces.first; s < chunks[i].surfaces.last; ++s) {
          const glm::uvec3 corners = mesh.triangles[s - instance.first_surface];
          const double u = uniform(random, 0, 1);
          const double v = uniform(random, 0, 1) * (1.0 - u);
          const glm::dvec3 point = glm::dvec3(mesh.positions[corners.x]) * (1.0 - u - v) +
                                   glm::dvec3(mesh.positions[corners.y]) * u +
                                   glm::dvec3(mesh.positions[corners.z]) * v;
          const glm::dvec4 world = instance.to_world * glm::dvec4(point, 1.0);
          const glm::dvec4 clip = from_world * glm::dvec4(glm::dvec3(world) - view.eye, 1.0);
          if (clip.z > clip.w || clip.z < 0.0 || clip.w <= 0.0) continue;
          const double px = std::floor(0.5 * (clip.x / clip.w + 1.0) * view.size().width);
          const double py = std::floor(0.5 * (1.0 - clip.y / clip.w) * view.size().height);
          if (px < 0.0 || py < 0.0 || px >= view.size().width || py >= view.size().height) continue;
          const Rect& pixels = of_chunk[i];
          ASSERT_TRUE(px >= pixels.x0 && px < pixels.x1 && py >= pixels.y0 && py < pixels.y1)
              << "trial " << trial << ", chunk " << i << ", pixel " << px << ' ' << py;
          ++inside;
        }
      }
    }
  }
  EXPECT_GT(inside, 10000);
  EXPECT_GT(tight, 50);
}

TEST(ChunkBounds, ChunksHoldTheSurfacesThatHaveKeysOnce) {
  Scene scene = scene_of_instances();
  scene.materials.emplace_back().alpha_mode = AlphaMode::Blend;
  scene.materials.back().base_color.a = 0.5F;
  scene.meshes[1].material = 1;
  std::vector<SurfaceRange> ranges;
  const SceneChunks made = make_scene_chunks(scene, 1);
  for (const SceneChunk& chunk : made.chunks) {
    EXPECT_GE(chunk.surfaces.first, made.clusters.at(chunk.cluster).first);
    EXPECT_LE(chunk.surfaces.last, made.clusters.at(chunk.cluster).last);
    EXPECT_LE(chunk.surfaces.count(), kChunkTriangles);
    EXPECT_TRUE(ranges.empty() || ranges.back().last <= chunk.surfaces.first);
    ranges.push_back(chunk.surfaces);
  }
  EXPECT_EQ(merged_ranges(ranges, scene.triangles), covering_surfaces(scene, false));
  EXPECT_EQ(merged_ranges(made.clusters, scene.triangles), covering_surfaces(scene, false));
  for (const SurfaceRange& cluster : made.clusters) EXPECT_LE(cluster.count(), kChunkTriangles);
}

}  // namespace
}  // namespace hpr
