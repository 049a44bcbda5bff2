#include "raster/geometry.h"

#include <gtest/gtest.h>

#include <map>
#include <vector>

#include "raster/raster_test_scenes.h"

namespace hpr {
namespace {

/// Surface id -> how often the pieces contain it; checks every triangle's corners and box on the way.
std::map<std::uint32_t, int> surfaces_of(const Scene& scene, const Geometry& geometry) {
  std::map<std::uint32_t, int> count;
  for (const Piece& piece : geometry.pieces) {
    const Instance& instance = scene.instances[piece.instance];
    for (const Chunk& chunk : std::span(geometry.chunks).subspan(piece.first_chunk, piece.chunks)) {
      const std::uint32_t last = std::min(chunk.first + chunk.count, piece.last);
      for (std::uint32_t t = std::max(chunk.first, piece.first); t < last; ++t) {
        ++count[instance.first_surface + t];
        const glm::uvec3 uploaded = geometry.triangles[chunk.slot + (t - chunk.first)];
        const glm::uvec3 wanted = scene.mesh_of(instance).triangles[t];
        for (int corner = 0; corner < 3; ++corner) {
          const glm::vec3 position = geometry.vertices[uploaded[corner]].position;
          EXPECT_EQ(position, scene.mesh_of(instance).positions[wanted[corner]]);
          EXPECT_TRUE(glm::all(glm::lessThanEqual(chunk.box.low, position)));
          EXPECT_TRUE(glm::all(glm::lessThanEqual(position, chunk.box.high)));
        }
        EXPECT_EQ(geometry.vertices[uploaded.z].triangle, t);
        EXPECT_TRUE(glm::all(glm::lessThanEqual(piece.box.low, chunk.box.low)));
        EXPECT_TRUE(glm::all(glm::lessThanEqual(chunk.box.high, piece.box.high)));
      }
    }
  }
  return count;
}

TEST(Geometry, HoldsExactlyTheTrianglesOfTheRangesInAscendingOrder) {
  const Scene scene = test::mixed_scene();
  const std::vector<SurfaceRange> ranges{{9000, 9001}, {100, 1500}, {1400, 1600},        {3100, 3300},
                                         {6000, 8000}, {50, 50},    {12000, 4000000000U}};
  const Geometry geometry = collect_geometry(scene, ranges);
  const auto count = surfaces_of(scene, geometry);
  for (std::uint32_t surface = 0; surface < scene.triangles; ++surface) {
    bool wanted = false;
    for (const SurfaceRange& range : ranges) wanted = wanted || (surface >= range.first && surface < range.last);
    const auto found = count.find(surface);
    EXPECT_EQ(found == count.end() ? 0 : found->second, wanted ? 1 : 0) << surface;
  }
  for (std::size_t i = 1; i < geometry.pieces.size(); ++i) {
    const Piece& before = geometry.pieces[i - 1];
    const Piece& piece = geometry.pieces[i];
    EXPECT_LE(scene.instances[before.instance].first_surface + before.last,
              scene.instances[piece.instance].first_surface + piece.first);
  }
}

TEST(Geometry, InstancesShareTheirMesh) {
  const Scene scene = test::mixed_scene();
  const Geometry geometry = collect_geometry(scene, std::array{test::all_of(scene)});
  EXPECT_EQ(geometry.triangles.size(), scene.meshes[0].triangles.size() + scene.meshes[1].triangles.size());
  EXPECT_LE(geometry.vertices.size(), 9000U + 3200U + 100U);
}

TEST(Geometry, LongMeshesAreCutIntoPieces) {
  Scene scene;
  scene.meshes = {test::waves(250)};
  scene.instances = {test::placed(0, {0.0, 0.0, 0.0})};
  finish_scene(scene);
  const Geometry geometry = collect_geometry(scene, std::array{SurfaceRange{700, 100000}});
  EXPECT_EQ(surfaces_of(scene, geometry).size(), 100000U - 700U);
  EXPECT_GT(geometry.pieces.size(), 2U);
  for (const Piece& piece : geometry.pieces) EXPECT_LE(piece.chunks, kPieceChunks);
  EXPECT_LT(geometry.vertices.size(), 102000U);
}

TEST(Geometry, PiecesOfRangesHoldTheirChunksAlone) {
  const Scene scene = test::mixed_scene();
  Geometry geometry = collect_geometry(scene, std::array{SurfaceRange{700, scene.triangles}});
  const std::uint32_t count = geometry.numbers().last;
  std::uint64_t chunks = 0;
  for (const Piece& piece : geometry.pieces) {
    EXPECT_EQ(piece.number, chunks);
    chunks += piece.chunks;
  }
  ASSERT_EQ(count, chunks);
  ASSERT_GT(count, 20U);
  const auto all = surfaces_of(scene, geometry);
  const auto in = [&](std::vector<ChunkRange> ranges) {
    Geometry part = geometry;
    part.pieces = pieces_of(geometry, ranges);
    return surfaces_of(scene, part);
  };
  EXPECT_EQ(in({{0, count}}), all);
  std::map<std::uint32_t, int> joined;
  for (std::uint32_t number = 0; number < count; ++number) {
    const auto one = in({{number, number + 1}});
    EXPECT_LE(one.size(), kChunkTriangles);
    joined.insert(one.begin(), one.end());
  }
  EXPECT_EQ(joined, all);
  auto ends = in({{0, 3}});
  ends.merge(in({{5, count}}));
  EXPECT_EQ(in({{0, 3}, {5, count}}), ends);
  EXPECT_EQ(ends.size() + in({{3, 5}}).size(), all.size());
  EXPECT_TRUE(pieces_of(geometry, {}).empty());
}

TEST(Geometry, OfNothingIsEmpty) {
  Scene scene;
  finish_scene(scene);
  EXPECT_TRUE(collect_geometry(scene, std::array{SurfaceRange{0, 10}}).pieces.empty());
  EXPECT_TRUE(collect_geometry(test::mixed_scene(), {}).triangles.empty());
}

}  // namespace
}  // namespace hpr
