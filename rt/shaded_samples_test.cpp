#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "rt/deferred_shader.h"
#include "rt/test_rooms.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

TEST(ShadedSamples, TogetherAreThoseOneByOne) {
  Scene scene = test::room(test::mirror(0.7F), true);
  scene.materials.back().alpha_mode = AlphaMode::Blend;
  scene.materials.back().base_color.a = 0.5F;
  scene.materials.front().roughness = 0.2F;
  Light& light = scene.lights.emplace_back();
  light.position = {0.3, 0.5, 0.2};
  light.intensity = glm::vec3(2.0F);
  std::vector<std::vector<View>> views;
  std::vector<TileLayer<Key>> keys;
  for (int i = 0; i < 5; ++i) {
    View view = test::view_from({0, 0, 0.95}, {0, -0.25, -1}, {150, 130}, scene, 1.3);
    view.jitter = {0.1 * i, -0.2 * i};
    views.push_back({view, view});
    keys.push_back(test::cast_keys(scene, views.back()));
  }
  const FrameLayout& layout = keys.front().layout();
  const std::vector<std::size_t> tiles = all_tiles(layout);
  DeferredShader shader(scene, {.threads = 2});
  std::vector<TileLayer<Rgb>> together;
  std::vector<TileLayer<Rgb>> normals;
  std::vector<TileLayer<float>> costs;
  for (std::size_t i = 0; i < views.size(); ++i) {
    together.emplace_back(layout);
    normals.emplace_back(layout);
    costs.emplace_back(layout);
  }
  std::vector<ShadedSample> samples;
  for (std::uint32_t i = 0; i < views.size(); ++i) {
    samples.push_back(
        {views[i], &keys[i], {.radiance = &together[i], .normal = &normals[i], .cost = &costs[i]}, {7, i}});
  }
  ASSERT_FALSE(shader.shades_one_by_one());
  shader.shade(samples, tiles);
  const RayCounts counts = shader.counts();
  RayCounts summed;
  for (std::uint32_t i = 0; i < views.size(); ++i) {
    TileLayer<Rgb> alone(layout);
    TileLayer<Rgb> normal(layout);
    TileLayer<float> cost(layout);
    shader.shade(views[i], keys[i], tiles, {.radiance = &alone, .normal = &normal, .cost = &cost}, {7, i});
    summed += shader.counts();
    for (const std::size_t tile : tiles) {
      EXPECT_TRUE(std::ranges::equal(alone.tile(tile), together[i].tile(tile))) << i << ' ' << tile;
      EXPECT_TRUE(std::ranges::equal(normal.tile(tile), normals[i].tile(tile))) << i << ' ' << tile;
      EXPECT_TRUE(std::ranges::equal(cost.tile(tile), costs[i].tile(tile))) << i << ' ' << tile;
    }
  }
  EXPECT_EQ(summed, counts);
}

/// Other pixels' light is not worked out, and what is worked out does not change but for the order of its sums.
TEST(ShadedSamples, OnlyPixelsThatAreWanted) {
  const Scene scene = test::room(test::mirror(0.7F), true);
  const std::vector<View> views(1, test::view_from({0, 0, 0.95}, {0, -0.25, -1}, {150, 130}, scene, 1.3));
  const TileLayer<Key> keys = test::cast_keys(scene, views);
  const FrameLayout& layout = keys.layout();
  const std::vector<std::size_t> tiles = all_tiles(layout);
  PixelMask wanted(layout);
  for (const std::size_t tile : tiles) {
    for (std::size_t pixel = 0; pixel < kTilePixels; ++pixel) wanted.tile(tile)[pixel] = pixel * 7919 % 5 == 0 ? 1 : 0;
    if (tile != 2) wanted.set_active(tile);  // there all are wanted
    if (tile == 3) std::ranges::fill(wanted.tile(tile), std::uint8_t{0});
  }
  for (const bool reference : {false, true}) {
    DeferredShader shader(scene, {.reference = reference, .threads = 2});
    TileLayer<Rgb> all(layout);
    shader.shade(views, keys, tiles, {.radiance = &all}, {7, 3});
    const RayCounts of_all = shader.counts();
    TileLayer<Rgb> some(layout);
    const ShadedSample sample{views, &keys, {.radiance = &some}, {7, 3}, &wanted};
    shader.shade(std::span(&sample, 1), tiles);
    EXPECT_LT(shader.counts()[PassId::Shadow], of_all[PassId::Shadow] / 2);
    for (const std::size_t tile : tiles) {
      for (std::size_t pixel = 0; pixel < kTilePixels; ++pixel) {
        if (wanted.active(tile) && wanted.tile(tile)[pixel] == 0) continue;
        EXPECT_NEAR(some.tile(tile)[pixel].g, all.tile(tile)[pixel].g, 1e-6 * all.tile(tile)[pixel].g);
      }
    }
  }
}

TEST(ShadedSamples, OnceOvertakenNoFurtherTileIsShaded) {
  const Scene scene = test::white_floor();
  const View view = test::view_from({0, 5, 0.1}, {0, 0, 0}, {256, 64}, scene);
  const TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
  TileLayer<Rgb> radiance(keys.layout());
  const ShadedSample sample{std::span(&view, 1), &keys, {.radiance = &radiance}, {}};
  DeferredShader shader(scene, {.threads = 1});
  int asked = 0;
  shader.shade(std::span(&sample, 1), all_tiles(keys.layout()), [&] { return ++asked > 2; });
  const std::vector<std::size_t> tiles = all_tiles(keys.layout());
  EXPECT_EQ(std::ranges::count_if(tiles, [&](std::size_t tile) { return radiance.active(tile); }), 2);
}

}  // namespace
}  // namespace hpr
