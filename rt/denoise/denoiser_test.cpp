#include "rt/denoise/denoiser.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "rt/denoise/test_denoiser.h"

namespace hpr {
namespace {

using test::add_material;
using test::add_mesh;
using test::corner;
using test::denoised;
using test::expect_same_inside;
using test::kGathered;
using test::look;
using test::mean;
using test::mean_picture;
using test::painted_floor;
using test::place_mesh;
using test::quad;
using test::squared_error;

TEST(Denoiser, TakesMostOfTheErrorOfOneSampleAndKeepsTheMean) {
  const Scene scene = corner(test::diffuse(glm::vec3(0.5F)), glm::vec3(0.8F), {0.2F, 0.4F, 0.6F}, 12);
  const View view = look(scene, {70, 52});
  const Image<Rgb> truth = mean_picture(scene, view, kGathered, 256);
  const Image<Rgb> plain = mean_picture(scene, view, kGathered, 1);
  const Image<Rgb> smooth = mean_picture(scene, view, denoised(kGathered), 1);
  EXPECT_LT(squared_error(smooth, truth), 0.2 * squared_error(plain, truth));
  EXPECT_NEAR(mean(smooth) / mean(truth), 1.0, 0.01);
}

TEST(Denoiser, LeavesSamplesPastTheFirstAlone) {
  const Scene scene = corner(test::diffuse(glm::vec3(0.5F)));
  const View view = look(scene);
  for (const std::uint32_t sample : {kDenoisedSamples - 1, kDenoisedSamples}) {
    const TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
    TileLayer<Rgb> plain(keys.layout());
    TileLayer<Rgb> smooth(keys.layout());
    for (TileLayer<Rgb>* const layer : {&plain, &smooth}) {
      DeferredShader shader(scene, layer == &plain ? kGathered : denoised(kGathered));
      shader.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = layer}, {.sample = sample});
    }
    EXPECT_EQ(std::ranges::equal(plain.tile(0), smooth.tile(0)), sample == kDenoisedSamples) << sample;
  }
}

/// Half of each pixel on the edge of a black sheet before a white sky is seen, whatever the pixel's one sample sees.
TEST(Denoiser, ResamplesEdges) {
  Scene scene;
  add_material(scene, test::diffuse(glm::vec3(0.0F)));
  place_mesh(scene, add_mesh(scene, quad({-4, -4, 0}, {4, 0, 0}, {0, 8, 0}, 0)));
  scene.environment = test::even_light({1.0F, 1.0F, 1.0F});
  finish_scene(scene);
  const View view = test::view_from({0, 0, 3}, {0, 0, 0}, {65, 65}, scene);  // the edge goes through column 32
  const test::Shaded plain = test::shade(scene, view, kGathered);
  const test::Shaded smooth = test::shade(scene, view, denoised(kGathered));
  for (int y = 0; y < 64; ++y) {
    EXPECT_EQ(plain.image.at(31, y).g + 1.0F, plain.image.at(33, y).g);
    EXPECT_NEAR(smooth.image.at(32, y).g, 0.5, 0.04) << y;  // halved five times: a sixty-fourth of a pixel
    EXPECT_EQ(smooth.image.at(30, y).g, 0.0F);
    EXPECT_EQ(smooth.image.at(34, y).g, 1.0F);
  }
}

/// The alpha of a pixel on an edge is what its resampled parts cover, and its color is that of the same parts.
TEST(Denoiser, ResamplesTheAlphaOfEdges) {
  Scene scene;
  Material sheet = test::diffuse();
  sheet.unlit = true;
  add_material(scene, sheet);
  place_mesh(scene, add_mesh(scene, quad({-4, -4, 0}, {4, 0, 0}, {0, 8, 0}, 0)));
  finish_scene(scene);
  const View view = test::view_from({0, 0, 3}, {0, 0, 0}, {65, 65}, scene);  // the edge goes through column 32
  const TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
  TileLayer<Rgb> radiance(keys.layout());
  TileLayer<float> coverage(keys.layout());
  RaySettings settings = denoised({});
  settings.background.kind = Background::Kind::Transparent;
  DeferredShader shader(scene, settings);
  shader.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &radiance, .coverage = &coverage});
  const Image<float> alpha = to_image(coverage, 0);
  const Image<Rgb> color = to_image(radiance, 0);
  for (int y = 0; y < 64; ++y) {
    EXPECT_NEAR(alpha.at(32, y), 0.5, 0.04) << y;
    EXPECT_NEAR(alpha.at(32, y), color.at(32, y).g, 1e-6) << y;
    EXPECT_EQ(alpha.at(30, y), 1.0F);
    EXPECT_EQ(alpha.at(34, y), 0.0F);
  }
}

/// What is thinner than a pixel is met by some samples only: looking more closely when it is must not weigh it less.
TEST(Denoiser, ThinThingsKeepTheirLight) {
  Scene scene;
  add_material(scene, test::diffuse(glm::vec3(0.0F)));
  for (int i = -6; i <= 6; ++i) {
    place_mesh(scene, add_mesh(scene, quad({0.2F * static_cast<float>(i), -4, 0}, {0.007F, 0, 0}, {0.9F, 8, 0}, 0)));
  }
  scene.environment = test::even_light({1.0F, 1.0F, 1.0F});
  finish_scene(scene);
  const View view = test::view_from({0, 0, 3}, {0, 0, 0}, {64, 64}, scene);
  const double truth = 1.0 - mean(mean_picture(scene, view, kGathered, 256));
  // The mean over places of a frame's samples, each of which is the first.
  double dark = 0.0;
  constexpr int kFrames = 64;
  test::for_each_shaken(scene, view, denoised(kGathered), kFrames, [&](const TileLayer<Rgb>& radiance) {
    for (const Rgb& color : radiance.tile(0)) dark += (1.0 - static_cast<double>(color.g)) / kTilePixels / kFrames;
  });
  EXPECT_GT(truth, 0.01);
  EXPECT_NEAR(dark / truth, 1.0, 0.02);
}

TEST(Denoiser, TexturesStay) {
  const Scene scene = painted_floor();
  const View view = test::view_from({0.5, 5, 1}, {0, 0, 0}, {90, 66}, scene);
  const Image<Rgb> plain = test::shade(scene, view, kGathered).image;
  expect_same_inside(test::shade(scene, view, denoised(kGathered)).image, plain, 1e-5F);
}

/// A mirror that shows something black, and beside it in the same plane what is matte and sees the sky about that.
TEST(Denoiser, NoLightCrossesToAnotherMaterial) {
  Scene scene;
  add_material(scene, test::diffuse(glm::vec3(0.5F)));
  add_material(scene, test::mirror(0.5F));
  add_material(scene, test::diffuse(glm::vec3(0.0F)));
  place_mesh(scene, add_mesh(scene, quad({-1, -1, 0}, {1, 0, 0}, {0, 2, 0}, 0)));
  place_mesh(scene, add_mesh(scene, quad({0, -1, 0}, {1, 0, 0}, {0, 2, 0}, 1)));
  place_mesh(scene, add_mesh(scene, quad({4, -4, 4}, {-8, 0, 0}, {0, 8, 0}, 2)));
  scene.environment = test::even_light({1.0F, 1.0F, 1.0F});
  finish_scene(scene);
  const View view = test::view_from({0, 0, 3}, {0, 0, 0}, {64, 64}, scene, 0.5);
  RaySettings settings = kGathered;
  settings.passes.push_back(PassId::Reflection);
  const Image<Rgb> smooth = test::shade(scene, view, denoised(settings)).image;
  float beside = 0.0F;
  for (int y = 0; y < 64; ++y) {
    for (int x = 33; x < 64; ++x) ASSERT_EQ(smooth.at(x, y).g, 0.0F) << x << ' ' << y;
    beside += smooth.at(30, y).g;
  }
  EXPECT_GT(beside, 64 * 0.1F);
}

TEST(Denoiser, HasTheSameBitsHoweverSamplesAndTilesAreLit) {
  Scene scene = corner(test::mirror(0.9F));
  scene.materials[0].roughness = 0.2F;
  scene.materials[0].ior = 1.5F;
  Light& light = scene.lights.emplace_back();
  light.position = {1.0, 5.0, 2.0};
  light.intensity = glm::vec3(20.0F);
  finish_scene(scene);
  std::vector<View> views;
  std::vector<TileLayer<Key>> keys;
  for (int i = 0; i < 3; ++i) {
    View& view = views.emplace_back(look(scene));
    view.jitter = {0.1 * i, -0.2 * i};
  }
  for (const View& view : views) keys.push_back(test::cast_keys(scene, std::span(&view, 1)));
  const FrameLayout& layout = keys.front().layout();
  const std::vector<std::size_t> tiles = all_tiles(layout);
  RaySettings settings = denoised(kGathered);
  settings.passes = {PassId::Gather, PassId::Shadow, PassId::Reflection};
  DeferredShader one(scene, settings);
  settings.threads = 3;
  DeferredShader three(scene, settings);
  std::vector<TileLayer<Rgb>> together;
  std::vector<TileLayer<Rgb>> parts;
  std::vector<TileLayer<float>> costs;
  for (std::size_t i = 0; i < views.size(); ++i) {
    together.emplace_back(layout);
    costs.emplace_back(layout);
    for (std::size_t part = 0; part < kComponents; ++part) parts.emplace_back(layout);
  }
  std::vector<ShadedSample> samples;
  for (std::uint32_t i = 0; i < views.size(); ++i) {
    LightOutput output{.radiance = &together[i], .cost = &costs[i]};
    for (std::size_t part = 0; part < kComponents; ++part) output.components.at(part) = &parts[i * kComponents + part];
    samples.push_back({std::span(&views[i], 1), &keys[i], output, {7, i}});
  }
  three.shade(samples, tiles);
  for (std::uint32_t i = 0; i < views.size(); ++i) {
    TileLayer<Rgb> alone(layout);
    for (const std::size_t tile : tiles) {
      one.shade(std::span(&views[i], 1), keys[i], std::span(&tile, 1), {.radiance = &alone}, {7, i});
      EXPECT_TRUE(std::ranges::equal(alone.tile(tile), together[i].tile(tile))) << i << ' ' << tile;
      for (std::size_t pixel = 0; pixel < kTilePixels; ++pixel) {
        float sum = 0.0F;
        for (std::size_t part = 0; part < kComponents; ++part) {
          sum += parts[i * kComponents + part].tile(tile)[pixel].g;
        }
        ASSERT_NEAR(sum, together[i].tile(tile)[pixel].g, 1e-5) << pixel;
      }
    }
  }
  double rays = 0.0;
  for (const TileLayer<float>& cost : costs) {
    for (const std::size_t tile : tiles) {
      for (const float each : cost.tile(tile)) rays += static_cast<double>(each);
    }
  }
  const RayCounts& counts = three.counts();
  const double traced = static_cast<double>(counts.primary + counts[PassId::Shadow] + counts[PassId::Reflection] +
                                            counts[PassId::Gather]);
  EXPECT_LT(rays, traced);  // those that find outlines are no pixel's
  EXPECT_GT(rays, 0.5 * traced);
}

TEST(Denoiser, EmissionIsNotLent) {
  Scene scene = painted_floor();
  scene.materials[0].emissive = glm::vec3(100.0F);
  const View view = test::view_from({0.5, 5, 1}, {0, 0, 0}, {90, 66}, scene);
  const Image<Rgb> plain = test::shade(scene, view, kGathered).image;
  const Image<Rgb> smooth = test::shade(scene, view, denoised(kGathered)).image;
  expect_same_inside(smooth, plain, 0.0F);
}

/// Shadows of small lights have edges and no noise.
TEST(Denoiser, ShadowsOfSmallLightsKeepTheirEdges) {
  Scene scene;
  add_material(scene, test::diffuse());
  place_mesh(scene, add_mesh(scene, quad({-9, 0, 9}, {18, 0, 0}, {0, 0, -18}, 0)));
  place_mesh(scene, add_mesh(scene, quad({0.8F, 2, 0.2F}, {0.4F, 0, 0}, {0, 0, -0.4F}, 0)));
  Light& light = scene.lights.emplace_back();
  light.position = {0.0, 4.0, 0.0};
  light.intensity = glm::vec3(20.0F);
  finish_scene(scene);
  const View view = test::view_from({4, 1.5, 0}, {2, 0, 0}, {64, 64}, scene);
  const RaySettings settings{.passes = {PassId::Shadow}};
  const Image<Rgb> plain = test::shade(scene, view, settings).image;
  const Image<Rgb> smooth = test::shade(scene, view, denoised(settings)).image;
  EXPECT_GT(std::ranges::count(plain.pixels(), Rgb{}), 100);
  EXPECT_LT(std::ranges::count(plain.pixels(), Rgb{}), 2000);
  for (std::size_t i = 0; i < plain.pixels().size(); ++i) ASSERT_NEAR(plain.pixels()[i].g, smooth.pixels()[i].g, 1e-6);
}

/// A sample that sees the sky through a hole stands alone among dark ones, yet its neighbors are lit like it.
TEST(Denoiser, SkyThroughAHoleIsShared) {
  Scene scene;
  add_material(scene, test::diffuse(glm::vec3(0.5F)));
  place_mesh(scene, add_mesh(scene, quad({-4, 0, 4}, {8, 0, 0}, {0, 0, -8}, 0)));
  for (const float x : {-16.0F, 0.15F}) {  // a ceiling with a slit
    place_mesh(scene, add_mesh(scene, quad({x, 2, -20}, {15.85F, 0, 0}, {0, 0, 40}, 0)));
  }
  scene.environment = Environment{Image<Rgb>({16, 8}, {1.0F, 1.0F, 1.0F})};
  finish_scene(scene);
  const View view = test::view_from({0, 1, 1.5}, {0, 0, 0}, {64, 64}, scene);
  const RaySettings settings{.passes = {PassId::Shadow}};
  const Image<Rgb> truth = mean_picture(scene, view, settings, 128);
  const double plain = squared_error(mean_picture(scene, view, settings, 1), truth);
  const double smooth = squared_error(mean_picture(scene, view, denoised(settings), 1), truth);
  EXPECT_LT(smooth, 0.1 * plain) << smooth / plain;
}

/// Stripes of light and of black on one surface, thinner than pixels: subpixel samples at its edges see both.
TEST(Denoiser, SubpixelSamplesSeeWhatGlowsInPart) {
  Scene scene;
  Material striped = test::glowing(glm::vec3(1.0F));
  striped.emissive_texture.texture = 0;
  add_material(scene, striped);
  Texture stripes;
  stripes.nearest = true;
  Image<Rgba8> image({64, 1});
  for (int x = 0; x < 64; ++x) image.at(x, 0) = x % 2 == 0 ? Rgba8{255, 255, 255, 255} : Rgba8{0, 0, 0, 255};
  stripes.image = std::move(image);
  scene.textures.push_back(stripes);
  for (int i = -6; i <= 6; ++i) {
    place_mesh(scene, add_mesh(scene, quad({0.2F * static_cast<float>(i), -4, 0}, {0.1F, 0, 0}, {0.4F, 8, 0}, 0)));
  }
  finish_scene(scene);
  const View view = test::view_from({0, 0, 3}, {0, 0, 0}, {64, 64}, scene);
  const RaySettings settings{.passes = {PassId::Shadow}};
  const double truth = mean(mean_picture(scene, view, settings, 256));
  EXPECT_NEAR(mean(mean_picture(scene, view, denoised(settings), kDenoisedSamples)) / truth, 1.0, 0.02);
}

/// What lies past the far plane of parallel rays is not there, between its corners either.
TEST(Denoiser, SubpixelSamplesEndAtTheFarPlane) {
  Scene scene;
  add_material(scene, test::diffuse());
  place_mesh(scene, add_mesh(scene, quad({-0.49F, -0.49F, 0}, {0.98F, 0, 0}, {0, 0.98F, 0}, 0)));
  // Out of sight: both scenes are of one size, and rounded alike.
  place_mesh(scene, add_mesh(scene, quad({4, 4, -4}, {1, 0, 0}, {0, 1, 0}, 0)));
  place_mesh(scene, add_mesh(scene, quad({-0.8F, -0.8F, -4}, {1.1F, 0, 0}, {0, 1.1F, 0}, 0)));
  scene.background = {0.25F, 0.25F, 0.25F};
  Scene near = scene;
  near.instances.pop_back();
  finish_scene(scene);
  finish_scene(near);
  View view = test::view_from({0, 0, 2}, {0, 0, 0}, {48, 48}, scene);
  view.orthographic = true;
  view.left = view.bottom = -1.0;
  view.right = view.top = 1.0;
  view.near_distance = 0.5;
  view.far_distance = 4.0;
  const TileLayer<Key> keys = test::cast_keys(near, std::span(&view, 1));
  TileLayer<Rgb> with(keys.layout());
  TileLayer<Rgb> without(keys.layout());
  for (const auto& [shown, layer] : {std::pair(&scene, &with), std::pair(&near, &without)}) {
    DeferredShader shader(*shown, denoised({.passes = {PassId::Shadow}}));
    shader.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = layer});
  }
  EXPECT_TRUE(std::ranges::equal(with.tile(0), without.tile(0)));
  EXPECT_EQ(with.at(0, 5, 24).g, 0.25F);
}

}  // namespace
}  // namespace hpr
