#include "raster/chunk_triangles.h"

#include <gtest/gtest.h>

#include <map>
#include <tuple>

#include "raster/raster_test_scenes.h"

namespace hpr {
namespace {

/// Per surface id of the pieces, in their order, its corners as they would be uploaded.
std::map<std::uint32_t, std::array<glm::vec3, 3>> corners_of(const Scene& scene, const Geometry& geometry) {
  std::map<std::uint32_t, std::array<glm::vec3, 3>> corners;
  std::uint32_t end = 0;
  std::uint32_t number = 0;
  for (const Piece& piece : geometry.pieces) {
    const std::uint32_t base = scene.instances[piece.instance].first_surface;
    EXPECT_GE(base + piece.first, end);
    EXPECT_EQ(piece.number, number);
    number += static_cast<std::uint32_t>(piece.chunks);
    end = base + piece.last;
    for (const Chunk& chunk : std::span(geometry.chunks).subspan(piece.first_chunk, piece.chunks)) {
      const std::uint32_t last = std::min(chunk.first + chunk.count, piece.last);
      for (std::uint32_t t = std::max(chunk.first, piece.first); t < last; ++t) {
        const glm::uvec3 triangle = geometry.triangles[chunk.slot + (t - chunk.first)];
        EXPECT_EQ(geometry.vertices[triangle.z].triangle, t);
        auto& found = corners[base + t];
        for (int corner = 0; corner < 3; ++corner) {
          const glm::vec3 position = geometry.vertices[triangle[corner]].position;
          found.at(static_cast<std::size_t>(corner)) = position;
          EXPECT_TRUE(glm::all(glm::lessThanEqual(chunk.box.low, position)));
          EXPECT_TRUE(glm::all(glm::lessThanEqual(position, chunk.box.high)));
        }
      }
    }
  }
  return corners;
}

TEST(ChunkTriangles, PartsThatWerePackedAreTheWholeAgain) {
  const Scene scene = test::mixed_scene();
  const auto expected = corners_of(scene, collect_geometry(scene, std::array{test::all_of(scene)}));
  ASSERT_EQ(expected.size(), scene.triangles);
  // Parts whose ranges lie between each other's, with borders inside of chunks.
  const std::array<std::vector<SurfaceRange>, 3> parts{
      {{{700, 3300}, {9000, scene.triangles}}, {{0, 700}}, {{3300, 9000}}}};
  std::vector<std::vector<std::byte>> packed;
  for (const auto& part : parts) {
    const Geometry geometry = collect_geometry(scene, part);
    packed.push_back(pack_triangles(scene, geometry, std::array{geometry.numbers()}));
  }
  packed.emplace_back();
  const Geometry whole = unpack_triangles(scene, packed);
  EXPECT_TRUE(corners_of(scene, whole) == expected);

  const Geometry geometry = collect_geometry(scene, parts[0]);
  const std::vector<ChunkRange> some{{1, 3}, {5, 6}};
  Geometry wanted = geometry;
  wanted.pieces = pieces_of(geometry, some);
  const auto few = unpack_triangles(scene, std::array{pack_triangles(scene, geometry, some)});
  EXPECT_TRUE(corners_of(scene, few).contains(700 + kChunkTriangles));
  std::uint32_t triangles = 0;
  for (const Piece& piece : wanted.pieces) triangles += piece.last - piece.first;
  EXPECT_GT(triangles, kChunkTriangles);
  EXPECT_EQ(triangles, few.triangles.size());
  EXPECT_TRUE(unpack_triangles(scene, {}).pieces.empty());
}

}  // namespace
}  // namespace hpr
