#include <gtest/gtest.h>

#include <algorithm>

#include "rt/deferred_shader.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

using test::add_material;
using test::add_mesh;
using test::place_mesh;
using test::quad;

// Before a sky: a board, and a pane over its rim that lets half of the light through.
TEST(ShadeLocal, WhatItLeavesEmptyIsLitLikeAllElse) {
  Scene scene;
  place_mesh(scene, add_mesh(scene, quad({-2, -2, 0}, {2, 0, 0}, {0, 4, 0}, add_material(scene, test::diffuse()))));
  Material pane = test::diffuse();
  pane.alpha_mode = AlphaMode::Blend;
  pane.base_color.a = 0.5F;
  place_mesh(scene, add_mesh(scene, quad({-1, -1, 1}, {2, 0, 0}, {0, 2, 0}, add_material(scene, pane))));
  scene.environment = test::even_light({0.2F, 0.5F, 0.8F});
  finish_scene(scene);
  const View view = test::view_from({0, 0, 6}, {0, 0, 0}, {64, 64}, scene, 0.7);
  TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
  const std::vector<std::size_t> tiles{0};
  TileLayer<Rgb> expected(keys.layout());
  DeferredShader shader(scene, {});
  shader.shade(std::span(&view, 1), keys, tiles, {.radiance = &expected});
  shade_local(shader, std::span(&view, 1), keys, tiles);
  constexpr Rgb kUntouched{7.0F, 7.0F, 7.0F};
  TileLayer<Rgb> radiance(keys.layout());
  std::ranges::fill(radiance.tile(0), kUntouched);
  shade_empty(shader, std::span(&view, 1), keys, tiles, {.radiance = &radiance});
  std::size_t empty = 0;
  for (std::size_t i = 0; i < kTilePixels; ++i) {
    empty += keys.tile(0)[i] == kNoKey ? 1U : 0U;
    ASSERT_EQ(radiance.tile(0)[i], keys.tile(0)[i] == kNoKey ? expected.tile(0)[i] : kUntouched);
  }
  EXPECT_GT(empty, kTilePixels / 4);
  EXPECT_LT(empty, kTilePixels);
}

}  // namespace
}  // namespace hpr
