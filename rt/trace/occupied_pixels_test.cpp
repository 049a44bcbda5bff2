#include "rt/trace/occupied_pixels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>

#include "rt/test_scene.h"

namespace hpr {
namespace {

/// One mesh of a ball and a smaller one far from it; their triangles come in no order.
Scene two_balls() {
  Scene scene;
  Mesh mesh = test::sphere(1.0, 32, 0);
  const Mesh other = test::sphere(0.3, 16, 0);
  const auto offset = static_cast<std::uint32_t>(mesh.positions.size());
  for (const glm::vec3& position : other.positions) mesh.positions.push_back(position + glm::vec3(4.0F, 3.0F, -4.0F));
  for (const glm::uvec3& triangle : other.triangles) mesh.triangles.push_back(triangle + offset);
  mesh.normals.clear();
  std::ranges::shuffle(mesh.triangles, std::mt19937(7));
  test::place_mesh(scene, test::add_mesh(scene, std::move(mesh)));
  finish_scene(scene);
  return scene;
}

TEST(OccupiedPixels, AreFewMoreThanAMeshCoversHoweverItsTrianglesAreOrdered) {
  const Scene scene = two_balls();
  const View view = test::view_from({0.0, 0.0, 9.0}, {1.0, 0.7, 0.0}, {160, 120}, scene);
  const RayScene rays(scene, RaySpace(scene), 1);
  const FrameLayout layout({view.size()});
  const OccupiedPixels occupied(scene, rays, MeshBoxes(scene), std::span(&view, 1), layout, 0);
  const TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
  std::size_t covered = 0;
  std::size_t marked = 0;
  for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
    std::array<std::uint8_t, kTilePixels> mask{};
    const bool any = occupied.mark(tile, layout.place(tile).pixels, mask);
    const auto count = static_cast<std::size_t>(std::ranges::count(mask, std::uint8_t{1}));
    EXPECT_EQ(any, count > 0);
    marked += count;
    for (std::size_t pixel = 0; pixel < kTilePixels; ++pixel) {
      if (keys.tile(tile)[pixel] == kNoKey) continue;
      ++covered;
      EXPECT_EQ(mask.at(pixel), 1) << "pixel " << pixel << " of tile " << tile;
    }
  }
  EXPECT_GT(covered, 800U);
  EXPECT_LT(marked, 2 * covered);
}

}  // namespace
}  // namespace hpr
