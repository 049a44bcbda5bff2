#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <utility>

#include "rt/denoise/test_denoiser.h"

// What the denoiser makes of light that few samples find, and of what smooth surfaces blur.
namespace hpr::test {
namespace {

double brightest(const Image<Rgb>& image) {
  return static_cast<double>(std::ranges::max(image.pixels(), {}, &Rgb::g).g);
}

Material shiny(float roughness) {
  Material material = mirror(0.9F);
  material.roughness = roughness;
  return material;
}

/// A floor beside a mirror, which shows it a lamp: one of its rays in many finds that.
Scene mirrored_lamp(float radiance, float side = 0.8F) {
  Scene scene;
  add_material(scene, diffuse(glm::vec3(0.5F)));
  add_material(scene, mirror(0.9F));
  add_material(scene, glowing(glm::vec3(radiance)));
  place_mesh(scene, add_mesh(scene, quad({-3, 0, 3}, {6, 0, 0}, {0, 0, -6}, 0)));
  place_mesh(scene, add_mesh(scene, quad({3, 0, 3}, {0, 0, -6}, {0, 6, 0}, 1)));
  place_mesh(scene, add_mesh(scene, quad({-side / 2, 3, -side / 2}, {side, 0, 0}, {0, 0, side}, 2)));
  return scene;
}

/// Across tiles as well as where they end each other's filters.
TEST(Denoiser, RareLightLeavesNoSalt) {
  Scene scene = mirrored_lamp(1e4F);
  finish_scene(scene);
  const View view = view_from({0, 2.5, 0.01}, {0, 0, 0}, {150, 100}, scene);
  for (const bool across_tiles : {false, true}) {
    RaySettings settings = kGathered;
    settings.filter_across_tiles = across_tiles;
    const Image<Rgb> plain = mean_picture(scene, view, settings, 2);
    const Image<Rgb> smooth = mean_picture(scene, view, denoised(settings), 2);
    EXPECT_GT(count_salt(plain), 20U);
    EXPECT_EQ(count_salt(smooth), 0U) << across_tiles;
    EXPECT_GT(mean(smooth) / mean(plain), 0.85);
    // Nor blotches: of the lamp's light, 4500, a window has less than three times what is about.
    EXPECT_LT(brightest(smooth), 10.0 * mean(smooth));
  }
}

/// What is not much brighter than all about keeps its light, at the edges of tiles too.
TEST(Denoiser, LightOfFewPixelsIsShared) {
  Scene scene = mirrored_lamp(12.0F, 2.0F);
  scene.environment = even_light({1.0F, 1.0F, 1.0F});
  finish_scene(scene);
  const View view = view_from({0, 2.5, 0.01}, {0, 0, 0}, {150, 100}, scene);
  RaySettings settings = kGathered;
  const Image<Rgb> plain = mean_picture(scene, view, settings, 4);
  EXPECT_GT(count_salt(mean_picture(scene, view, settings, 1), 2.0F), 10U);
  for (const bool across_tiles : {false, true}) {
    settings.filter_across_tiles = across_tiles;
    EXPECT_NEAR(mean(mean_picture(scene, view, denoised(settings), 4)) / mean(plain), 1.0, 0.01) << across_tiles;
  }
}

/// What a mirror shows may be as small as a pixel, and what a nearly smooth surface does.
TEST(Denoiser, PointsInMirrorsStay) {
  for (const float roughness : {0.0F, 0.01F}) {
    Scene scene;
    add_material(scene, shiny(roughness));
    add_material(scene, glowing(glm::vec3(100.0F)));
    place_mesh(scene, add_mesh(scene, quad({-3, 0, 3}, {6, 0, 0}, {0, 0, -6}, 0)));
    for (int i = -3; i <= 3; ++i) {
      place_mesh(scene,
                 add_mesh(scene, quad({0.5F * static_cast<float>(i), 3, -0.5F}, {0.04F, 0, 0}, {0, 0, 0.04F}, 1)));
    }
    finish_scene(scene);
    const View view = view_from({0, 2.5, 0.01}, {0, 0, 0}, {90, 66}, scene);
    const RaySettings settings{.passes = {PassId::Reflection}};
    const Image<Rgb> plain = shade(scene, view, settings).image;
    EXPECT_GT(count_salt(plain), 2U);
    expect_same_inside(shade(scene, view, denoised(settings)).image, plain, roughness > 0.0F ? 0.1F : 1e-6F);
  }
}

/// Small things and spots are no rare light.
TEST(Denoiser, BrightSpotsStay) {
  Scene scene;
  add_material(scene, diffuse(glm::vec3(0.05F)));
  add_material(scene, diffuse(glm::vec3(0.9F)));
  add_material(scene, glowing(glm::vec3(50.0F)));
  scene.materials[0].base_color_texture.texture = 0;
  Texture spots;
  spots.nearest = true;
  Image<Rgba8> image({64, 64}, {50, 50, 50, 255});
  for (int i = 0; i < 64; ++i) image.at((7 * i) % 64, i) = {255, 255, 255, 255};
  spots.image = std::move(image);
  scene.textures.push_back(spots);
  scene.materials[0].base_color = glm::vec4(0.9F);
  place_mesh(scene, add_mesh(scene, quad({-3, 0, 3}, {6, 0, 0}, {0, 0, -6}, 0)));
  for (int i = -6; i <= 6; ++i) {
    const float x = 0.2F * static_cast<float>(i);
    place_mesh(scene, add_mesh(scene, quad({x, 0.001F, 1.0F}, {0.05F, 0, 0}, {0, 0, -0.05F}, 1)));
  }
  place_mesh(scene, add_mesh(scene, quad({-2, 6, -2}, {4, 0, 0}, {0, 0, 4}, 2)));
  finish_scene(scene);
  const View view = view_from({0, 5, 0.01}, {0, 0, 0}, {90, 66}, scene);
  const RaySettings settings{.passes = {PassId::Shadow}};
  EXPECT_GT(count_salt(shade(scene, view, settings).image), 20U);
  const Image<Rgb> plain = mean_picture(scene, view, settings, 8);
  EXPECT_GT(mean(mean_picture(scene, view, denoised(settings), 8)) / mean(plain), 0.99);
}

/// A floor shows what touches it sharp, however rough it is.
TEST(Denoiser, WhatTouchesAShinyFloorStaysSharp) {
  Scene scene;
  add_material(scene, shiny(0.1F));
  add_material(scene, glowing(glm::vec3(1.0F)));
  place_mesh(scene, add_mesh(scene, quad({-4, 0, 4}, {8, 0, 0}, {0, 0, -8}, 0)));
  for (int i = -12; i < 12; ++i) {
    const float x = 0.5F * static_cast<float>(i);
    place_mesh(scene, add_mesh(scene, quad({x, 0.0F, -1}, {0.25F, 0, 0}, {0, 0.2F, 0}, 1)));
  }
  finish_scene(scene);
  const View view = view_from({0, 3, 6}, {0, 0, -1}, {160, 120}, scene, 0.5);
  const RaySettings settings{.passes = {PassId::Reflection}};
  const Image<Rgb> truth = mean_picture(scene, view, settings, 128);
  const double plain = squared_error(mean_picture(scene, view, settings, 8), truth);
  const double smooth = squared_error(mean_picture(scene, view, denoised(settings), 8), truth);
  EXPECT_LT(smooth, 1.6 * plain) << smooth / plain;  // else 6.8
}

/// Of a lamp that a shiny floor shows, by way of a mirror so that nobody looks for it there.
TEST(Denoiser, LampsInShinyFloorsLeaveNoSalt) {
  Scene scene;
  add_material(scene, shiny(0.2F));
  add_material(scene, mirror(0.9F));
  add_material(scene, glowing(glm::vec3(3000.0F)));
  place_mesh(scene, add_mesh(scene, quad({-4, 0, 4}, {8, 0, 0}, {0, 0, -8}, 0)));
  place_mesh(scene, add_mesh(scene, quad({-4, 0, -4}, {8, 0, 0}, {0, 8, 0}, 1)));
  for (const float x : {-1.0F, 1.0F})
    place_mesh(scene, add_mesh(scene, quad({x, 2, 2}, {0, 0.3F, 0}, {0.3F, 0, 0}, 2)));
  scene.environment = even_light({0.1F, 0.1F, 0.1F});
  finish_scene(scene);
  const View view = view_from({0, 3, 6}, {0, 0, -0.5}, {160, 120}, scene, 0.25);
  const RaySettings settings{.passes = {PassId::Reflection}};
  const std::size_t plain = count_salt(mean_picture(scene, view, settings, 2));
  const std::size_t smooth = count_salt(mean_picture(scene, view, denoised(settings), 2));
  EXPECT_GT(plain, 15U);
  EXPECT_EQ(smooth, 0U);
}

/// Where a surface turns by more than its lobe from pixel to pixel, its neighbors show something else.
TEST(Denoiser, WhatAShinyBallShowsStaysSharp) {
  Scene scene;
  add_material(scene, shiny(0.2F));
  place_mesh(scene, add_mesh(scene, sphere(1.0, 16, 0)));
  Image<Rgb> stripes({16, 8});
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 16; x += 2) stripes.at(x, y) = {1.0F, 1.0F, 1.0F};
  }
  scene.environment = Environment{std::move(stripes)};
  finish_scene(scene);
  const View view = view_from({0, 0, 4}, {0, 0, 0}, {64, 64}, scene);
  const RaySettings settings{.passes = {PassId::Reflection}};
  const Image<Rgb> truth = mean_picture(scene, view, settings, 32);
  const double plain = squared_error(mean_picture(scene, view, settings, 8), truth);
  const double smooth = squared_error(mean_picture(scene, view, denoised(settings), 8), truth);
  EXPECT_LT(smooth, 1.1 * plain) << smooth / plain;
}

}  // namespace
}  // namespace hpr::test
