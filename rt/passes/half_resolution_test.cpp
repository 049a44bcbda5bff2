#include "rt/passes/half_resolution.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/error.h"
#include "rt/test_rooms.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

using test::add_material;
using test::add_mesh;
using test::corner;
using test::mean;
using test::place_mesh;
using test::quad;

const std::vector<PassId> kAll{PassId::Shadow, PassId::Reflection, PassId::Refraction, PassId::AmbientOcclusion,
                               PassId::Photon};
constexpr Size kOdd{139, 71};

View look(const Scene& scene, Size size = kOdd) {
  return test::view_from({0.5, 2, 7}, {0, 1, 0}, size, scene);
}

RaySettings halved(RaySettings settings, std::vector<PassId> passes) {
  settings.half_resolution = std::move(passes);
  return settings;
}

TEST(HalfResolution, OneRayInFourFollowsWhatIsShared) {
  const Scene shiny = corner(test::mirror(0.9F));
  const RaySettings settings{.passes = {PassId::Shadow, PassId::Reflection, PassId::AmbientOcclusion}};
  const View view = look(shiny);
  const test::Shaded full = test::shade(shiny, view, settings);
  const test::Shaded half = test::shade(shiny, view, halved(settings, kAll));
  const auto fraction = [](std::uint64_t few, std::uint64_t all) {
    return static_cast<double>(few) / static_cast<double>(all);
  };
  EXPECT_GE(fraction(half.counts[PassId::Shadow], full.counts[PassId::Shadow]), 0.25);
  EXPECT_LT(fraction(half.counts[PassId::Shadow], full.counts[PassId::Shadow]), 0.4);
  EXPECT_LT(fraction(half.counts[PassId::AmbientOcclusion], full.counts[PassId::AmbientOcclusion]), 0.35);
  EXPECT_LT(fraction(half.counts[PassId::Reflection], full.counts[PassId::Reflection]),
            0.7);  // the ball is small and round
  EXPECT_NEAR(mean(half.image) / mean(full.image), 1.0, 0.02);
  EXPECT_NE(half.image, full.image);
}

TEST(HalfResolution, RefractionIsShared) {
  Scene scene;
  add_material(scene, test::clear_glass(1.5F, 0.0F));
  add_material(scene, test::diffuse());
  place_mesh(scene, add_mesh(scene, quad({-4, -4, 0}, {8, 0, 0}, {0, 8, 0}, 0)));
  place_mesh(scene, add_mesh(scene, quad({-9, -9, -3}, {18, 0, 0}, {0, 18, 0}, 1)));
  scene.environment = test::even_light({1.0F, 1.0F, 1.0F});
  finish_scene(scene);
  const View view = test::view_from({0, 0, 3}, {0, 0, 0}, {64, 64}, scene);
  const std::uint64_t full = test::shade(scene, view).counts[PassId::Refraction];
  EXPECT_EQ(full, 64U * 64U);
  EXPECT_EQ(test::shade(scene, view, halved({}, {PassId::Refraction})).counts[PassId::Refraction], full / 4);
}

TEST(HalfResolution, WhatIsEvenStaysAsItIs) {
  // Under a sky with nothing in its way occlusion is the same all over: shared, it is made up for the base colour.
  Scene scene;
  Material painted = test::diffuse();
  add_material(scene, painted);
  Mesh floor = quad({-4, 0, 4}, {8, 0, 0}, {0, 0, -8}, 0);
  floor.colors = {
      {0.2F, 0.9F, 0.5F, 1.0F}, {0.9F, 0.8F, 0.5F, 1.0F}, {0.5F, 0.5F, 0.5F, 1.0F}, {0.7F, 0.3F, 0.5F, 1.0F}};
  place_mesh(scene, add_mesh(scene, floor));
  finish_scene(scene);
  const View view = test::view_from({0.5, 5, 1}, {0, 0, 0}, {90, 66}, scene);
  const RaySettings settings{.passes = {PassId::AmbientOcclusion}};
  const test::Shaded full = test::shade(scene, view, settings);
  const test::Shaded half = test::shade(scene, view, halved(settings, {PassId::AmbientOcclusion}));
  EXPECT_LT(half.counts[PassId::AmbientOcclusion], full.counts[PassId::AmbientOcclusion] * 3 / 10);
  for (std::size_t i = 0; i < full.image.pixels().size(); ++i) {
    ASSERT_NEAR(half.image.pixels()[i].r, full.image.pixels()[i].r, 1e-5) << i;
    ASSERT_NEAR(half.image.pixels()[i].g, full.image.pixels()[i].g, 1e-5) << i;
  }
}

TEST(HalfResolution, AnotherMaterialIsNotTheLike) {
  // Two materials of one look meet in a plane, on a line between the pixels of one column of blocks.
  Scene scene;
  add_material(scene, test::diffuse());
  add_material(scene, test::diffuse());
  const float border = static_cast<float>(-2.0 * 3.0 * std::tan(0.4) / 64.0);
  place_mesh(scene, add_mesh(scene, quad({-4, -4, 0}, {4 + border, 0, 0}, {0, 8, 0}, 0)));
  place_mesh(scene, add_mesh(scene, quad({border, -4, 0}, {4 - border, 0, 0}, {0, 8, 0}, 1)));
  finish_scene(scene);
  const View view = test::view_from({0, 0, 3}, {0, 0, 0}, {64, 64}, scene);
  const RaySettings settings{.passes = {PassId::AmbientOcclusion}, .occlusion_rays = 1};
  const test::Shaded half = test::shade(scene, view, halved(settings, {PassId::AmbientOcclusion}));
  EXPECT_EQ(half.counts[PassId::AmbientOcclusion], 32U * 32U + 64U);
}

TEST(HalfResolution, NoLightCrossesAnEdge) {
  // White before black: a pixel that borrowed from the other side would be far off.
  const Scene scene = corner(test::diffuse(glm::vec3(0.0F)), glm::vec3(1.0F), glm::vec3(0.0F));
  const View view = look(scene);
  const RaySettings settings{.passes = {PassId::AmbientOcclusion}};
  const Image<Rgb> full = test::shade(scene, view, settings).image;
  const Image<Rgb> half = test::shade(scene, view, halved(settings, {PassId::AmbientOcclusion, PassId::Shadow})).image;
  for (std::size_t i = 0; i < full.pixels().size(); ++i) {
    const bool black = full.pixels()[i].g == 0.0F;
    ASSERT_EQ(half.pixels()[i].g == 0.0F, black) << i;
  }
}

TEST(HalfResolution, HasTheSameBitsHoweverTilesAreSpread) {
  const Scene scene = corner(test::mirror(0.9F));
  const View view = look(scene);
  const TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
  RaySettings settings = halved({.passes = {PassId::Shadow, PassId::Reflection, PassId::AmbientOcclusion}}, kAll);
  for (const std::uint32_t sample : {0U, 3U}) {
    TileLayer<Rgb> whole(keys.layout());
    DeferredShader one(scene, settings);
    one.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &whole}, {.sample = sample});
    settings.threads = 3;
    TileLayer<Rgb> parts(keys.layout());
    DeferredShader other(scene, settings);
    for (std::size_t tile = keys.tiles(); tile-- > 0;) {
      other.shade(std::span(&view, 1), keys, std::span(&tile, 1), {.radiance = &parts}, {.sample = sample});
    }
    EXPECT_EQ(to_image(parts, 0), to_image(whole, 0));
  }
}

TEST(HalfResolution, ComponentsStillSumToTheColor) {
  const Scene scene = corner(test::mirror(0.9F));
  const View view = look(scene);
  const TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
  DeferredShader shader(scene,
                        halved({.passes = {PassId::Shadow, PassId::Reflection, PassId::AmbientOcclusion}}, kAll));
  TileLayer<Rgb> color(keys.layout());
  std::vector<TileLayer<Rgb>> parts(kComponents);
  LightOutput output{.radiance = &color};
  for (std::size_t i = 0; i < kComponents; ++i) {
    parts[i] = TileLayer<Rgb>(keys.layout());
    output.components.at(i) = &parts[i];
  }
  shader.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), output);
  for (int y = 0; y < kOdd.height; ++y) {
    for (int x = 0; x < kOdd.width; ++x) {
      float sum = 0.0F;
      for (const auto& part : parts) sum += part.at(0, x, y).g;
      ASSERT_NEAR(sum, color.at(0, x, y).g, 1e-4F) << x << ' ' << y;
    }
  }
}

TEST(HalfResolution, RefusesWhatIsNoPassOrCannotBeShared) {
  for (const char* const name : {"light", "", "Reflection", "gather"}) {
    EXPECT_THROW((void)parse_half_resolution_pass(name), Error) << name;
  }
  EXPECT_EQ(parse_half_resolution_pass("reflection"), PassId::Reflection);
  EXPECT_EQ(shared_components({}), 0);
}

}  // namespace
}  // namespace hpr
