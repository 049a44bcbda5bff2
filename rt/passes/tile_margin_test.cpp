#include "rt/passes/tile_margin.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "rt/denoise/test_denoiser.h"
#include "rt/test_rooms.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

using test::add_material;
using test::add_mesh;
using test::place_mesh;

/// One tile.
constexpr Size kSize{64, 64};

/// A sample of the picture of a screen that is cut at these columns and rows into blocks.
Image<Rgb> shade_in_blocks(const Scene& scene, const View& screen, const RaySettings& settings,
                           const std::vector<int>& columns, const std::vector<int>& rows, std::uint32_t sample) {
  std::vector<View> views;
  for (std::size_t row = 0; row + 1 < rows.size(); ++row) {
    for (std::size_t column = 0; column + 1 < columns.size(); ++column) {
      views.push_back(screen);
      views.back().block = {columns[column], rows[row], columns[column + 1], rows[row + 1]};
      views.back().jitter = sample == 0 ? glm::dvec2(0.0) : Sampler(7, sample).two() - 0.5;
    }
  }
  const TileLayer<Key> keys = test::cast_keys(scene, views);
  TileLayer<Rgb> radiance(keys.layout());
  DeferredShader shader(scene, settings);
  shader.shade(views, keys, all_tiles(keys.layout()), {.radiance = &radiance}, {.sample = sample});
  Image<Rgb> picture(screen.screen);
  for (std::size_t i = 0; i < views.size(); ++i) {
    paste(to_image(radiance, i), views[i].block.x0, views[i].block.y0, picture);
  }
  return picture;
}

/// A wall and a floor, shaded by an even sky and each other.
Scene room() {
  Scene scene;
  add_material(scene, test::diffuse({0.8F, 0.5F, 0.3F}));
  place_mesh(scene, add_mesh(scene, test::quad({-9, 0, 9}, {18, 0, 0}, {0, 0, -12}, 0)));
  place_mesh(scene, add_mesh(scene, test::quad({-9, 0, -3}, {18, 0, 0}, {0, 9, 0}, 0)));
  scene.environment = test::even_light({1.0F, 1.0F, 1.0F});
  finish_scene(scene);
  return scene;
}

/// A room with a shiny floor, and a small lamp that few rays find.
Scene lamp_room() {
  Scene scene = room();
  scene.materials[0].roughness = 0.1F;
  scene.materials[0].ior = 1.5F;
  const std::uint32_t lamp = add_material(scene, test::glowing(glm::vec3(1e4F)));
  place_mesh(scene, add_mesh(scene, test::quad({0, 1.5F, -2.5F}, {0.3F, 0, 0}, {0, 0, 0.3F}, lamp)));
  finish_scene(scene);
  return scene;
}

std::size_t count_other_pixels(const Image<Rgb>& a, const Image<Rgb>& b) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.pixels().size(); ++i) count += a.pixels()[i] == b.pixels()[i] ? 0U : 1U;
  return count;
}

/// Blocks show, bit for bit, what they show as one tile, wherever they are cut.
void expect_no_seams(const Scene& scene, const View& view, const RaySettings& settings, std::uint32_t samples) {
  for (std::uint32_t sample = 0; sample < samples; ++sample) {
    const Image<Rgb> whole = shade_in_blocks(scene, view, settings, {0, 64}, {0, 64}, sample);
    for (const std::vector<int>& columns : {std::vector{0, 29, 64}, {0, 32, 64}, {0, 1, 4, 50, 64}}) {
      for (const std::vector<int>& rows : {std::vector{0, 64}, {0, 41, 64}, {0, 2, 33, 64}}) {
        const Image<Rgb> cut = shade_in_blocks(scene, view, settings, columns, rows, sample);
        EXPECT_EQ(count_other_pixels(cut, whole), 0U)
            << "sample " << sample << " cut at " << columns[1] << ',' << rows[1];
      }
    }
  }
}

TEST(TileMargin, DenoisedBlocksHaveNoSeams) {
  const Scene scene = room();
  // Of the floor alone: how an edge bends is estimated within a tile.
  const View view = test::view_from({0.5, 2, -1}, {0.4, 0, -1.4}, kSize, scene);
  expect_no_seams(scene, view, {.passes = {PassId::Gather}, .max_depth = 4, .denoise = true}, 3);
  expect_no_seams(scene, view, {.passes = {PassId::Shadow}, .denoise = true}, 2);
}

/// Neither does what few samples find, which is shared out.
TEST(TileMargin, RareLightHasNoSeams) {
  const Scene scene = lamp_room();
  const View view = test::view_from({0.5, 2, -1}, {0.4, 0, -1.4}, kSize, scene);
  RaySettings settings{.passes = {PassId::Gather, PassId::Reflection}, .max_depth = 2};
  EXPECT_GT(test::count_salt(shade_in_blocks(scene, view, settings, {0, 64}, {0, 64}, 0)), 10U);
  settings.denoise = true;
  expect_no_seams(scene, view, settings, 2);
}

TEST(TileMargin, BlocksAtHalfResolutionHaveNoSeams) {
  const Scene scene = room();
  const View view = test::view_from({0.5, 2, 5}, {0, 1, 0}, kSize, scene);
  expect_no_seams(scene, view,
                  {.passes = {PassId::Shadow, PassId::AmbientOcclusion},
                   .half_resolution = {PassId::Shadow, PassId::AmbientOcclusion}},
                  5);
}

/// Pixels have the same bits wherever tiles end.
TEST(TileMargin, TilesHaveNoSeamsWhereFiltersCrossThem) {
  const Scene scene = room();
  View view = test::view_from({0.5, 2, -1}, {0.4, 0, -1.4}, {128, 128}, scene);
  for (const RaySettings& settings :
       {RaySettings{.passes = {PassId::Gather}, .max_depth = 4, .denoise = true, .filter_across_tiles = true},
        RaySettings{.passes = {PassId::Shadow, PassId::AmbientOcclusion},
        .half_resolution = {PassId::Shadow, PassId::AmbientOcclusion},
        .filter_across_tiles = true}}) {
    for (std::uint32_t sample = 0; sample < 2; ++sample) {
      const Image<Rgb> tiles = shade_in_blocks(scene, view, settings, {0, 128}, {0, 128}, sample);
      const Image<Rgb> other_tiles = shade_in_blocks(scene, view, settings, {0, 32, 128}, {0, 16, 128}, sample);
      EXPECT_EQ(count_other_pixels(tiles, other_tiles), 0U) << "sample " << sample;
      RaySettings within = settings;
      within.filter_across_tiles = false;
      EXPECT_NE(count_other_pixels(shade_in_blocks(scene, view, within, {0, 128}, {0, 128}, sample), tiles), 0U);
    }
  }
}

TEST(TileMargin, ScreensThatEndHaveNone) {
  const Scene scene = room();
  View view = test::view_from({0.5, 2, 5}, {0, 1, 0}, {150, 100}, scene);
  const auto strips = [&](const Rect& tile, bool across_tiles = false) {
    TileJob job;
    job.rect = tile;
    job.view = &view;
    return TileMargin::count(job, across_tiles);
  };
  EXPECT_EQ(strips({0, 0, 64, 64}), 0U);
  EXPECT_EQ(strips({128, 64, 150, 100}), 0U);
  view.block = {20, 0, 150, 100};
  EXPECT_EQ(strips({0, 0, 64, 64}), 1U);
  EXPECT_EQ(strips({64, 0, 128, 64}), 0U);
  view.block = {20, 0, 150, 90};
  EXPECT_EQ(strips({0, 64, 64, 90}), 3U);
  EXPECT_EQ(strips({64, 64, 128, 90}), 1U);
  EXPECT_EQ(strips({64, 64, 128, 90}, true), 8U);
  view.block = {0, 0, 150, 100};
  EXPECT_EQ(strips({64, 0, 128, 64}, true), 5U);
  EXPECT_EQ(strips({128, 64, 150, 100}, true), 3U);
}

}  // namespace
}  // namespace hpr
