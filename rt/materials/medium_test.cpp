#include "rt/materials/medium.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <numbers>

#include "rt/deferred_shader.h"
#include "rt/test_scene.h"

// Beer's law on every stretch within a solid, by the passes and by the reference.
namespace hpr {
namespace {

using test::add_material;
using test::add_mesh;
using test::place_mesh;
using test::quad;

/// A closed body of six quads that look outwards, each an instance of its own.
void add_box(Scene& scene, const glm::vec3& low, const glm::vec3& high, std::uint32_t material) {
  const glm::vec3 size = high - low;
  for (int axis = 0; axis < 3; ++axis) {
    glm::vec3 a(0.0F);
    glm::vec3 b(0.0F);
    glm::vec3 across(0.0F);
    a[(axis + 1) % 3] = size[(axis + 1) % 3];
    b[(axis + 2) % 3] = size[(axis + 2) % 3];
    across[axis] = size[axis];
    place_mesh(scene, add_mesh(scene, quad(low, b, a, material)));
    place_mesh(scene, add_mesh(scene, quad(low + across, a, b, material)));
  }
}

void add_box(Scene& scene, float half, std::uint32_t material) {
  add_box(scene, glm::vec3(-half), glm::vec3(half), material);
}

/// Neither mirrors nor bends, unless `ior` says so.
std::uint32_t add_absorber(Scene& scene, const glm::vec3& left_after_a_metre, float ior = 1.0F) {
  Material solid = test::clear_glass(ior, 1.0F);
  solid.attenuation_color = left_after_a_metre;
  solid.attenuation_distance = 1.0F;
  return add_material(scene, solid);
}

/// SubpixelOffsets straight at -z from (0.1, 0.07, z), where no diagonal of a quad is.
glm::dvec3 seen_from(double z, const Scene& scene, RaySettings settings, bool reference, std::uint32_t samples = 1) {
  settings.reference = reference;
  const View view = test::view_from({0.1, 0.07, z}, {0.1, 0.07, z - 1.0}, {1, 1}, scene, 1e-4);
  return test::mean_pixel(scene, view, 0, 0, samples, settings);
}

void expect_seen(const glm::dvec3& expected, double z, Scene scene, double tolerance = 1e-4) {
  finish_scene(scene);
  for (const bool reference : {false, true}) {
    // An index of 1.33 mirrors a little, by chance.
    const glm::dvec3 seen = seen_from(z, scene, {.max_depth = 32}, reference);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(seen[c] / expected[c], 1.0, tolerance) << reference << ' ' << c;
  }
}

TEST(Medium, WhatGlowsInASolidIsSeenThroughIt) {
  Scene scene;
  add_box(scene, 1.5F, add_absorber(scene, glm::vec3(0.5F)));
  add_box(scene, 0.5F, add_material(scene, test::glowing(glm::vec3(1.0F))));
  expect_seen(glm::dvec3(0.5), 5.0, std::move(scene));
}

TEST(Medium, AnEyeInASolidSeesItsWallAndTheSkyThroughIt) {
  Scene scene;
  add_box(scene, 1.0F, add_absorber(scene, glm::vec3(0.25F)));
  scene.environment = test::even_light({1.0F, 1.0F, 1.0F});
  expect_seen(glm::dvec3(0.25), 0.0, std::move(scene));
}

TEST(Medium, AnEyeInASolidSeesWhatGlowsThereThroughIt) {
  Scene scene;
  add_box(scene, 3.0F, add_absorber(scene, {0.2F, 0.5F, 0.9F}, 1.33F));
  add_box(scene, {-0.5F, -0.5F, -2.5F}, {0.5F, 0.5F, -1.5F}, add_material(scene, test::glowing(glm::vec3(1.0F))));
  expect_seen({std::pow(0.2, 1.5), std::pow(0.5, 1.5), std::pow(0.9, 1.5)}, 0.0, std::move(scene));
}

TEST(Medium, LightOfALampInASolidIsAbsorbedOnItsWay) {
  Scene scene;
  add_box(scene, 1.5F, add_absorber(scene, glm::vec3(0.5F)));
  add_box(scene, 0.5F, add_material(scene, test::diffuse()));
  // Half a metre before the wall: an irradiance of pi.
  Light lamp;
  lamp.position = {0.1, 0.07, 1.0};
  lamp.intensity = glm::vec3(0.25F * std::numbers::pi_v<float>);
  scene.lights.push_back(lamp);
  expect_seen(glm::dvec3(std::pow(0.5, 0.5) * 0.5), 5.0, std::move(scene));
}

TEST(Medium, PhotonsOfTheSunAreAbsorbedOnTheirWay) {
  Scene scene;
  add_box(scene, 1.5F, add_absorber(scene, glm::vec3(0.5F)));
  add_box(scene, 0.5F, add_material(scene, test::diffuse()));
  Light sun;
  sun.type = LightType::Directional;
  sun.intensity = glm::vec3(std::numbers::pi_v<float>);
  scene.lights.push_back(sun);
  finish_scene(scene);
  const RaySettings settings{.max_depth = 32, .photons = 20'000, .photon_radius = 0.2};
  EXPECT_NEAR(seen_from(5.0, scene, settings, false, 16).g, 0.25, 0.01);
}

/// A white floor at z = -1 under what stands between it and the sun, looked at from below that.
double sunlit_floor(Scene scene) {
  place_mesh(scene,
             add_mesh(scene, quad({-1.5F, -1.5F, -1}, {3, 0, 0}, {0, 3, 0}, add_material(scene, test::diffuse()))));
  Light sun;
  sun.type = LightType::Directional;
  sun.intensity = glm::vec3(std::numbers::pi_v<float>);
  scene.lights.push_back(sun);
  finish_scene(scene);
  const RaySettings settings{.max_depth = 32, .photons = 20'000, .photon_radius = 0.2};
  return seen_from(-0.5, scene, settings, false, 16).g;
}

TEST(Medium, FromWithoutTheSceneToTheInsideOfAWallNothingIsAbsorbed) {
  const auto below_a_pane = [](bool with_far_thing) {
    Scene scene;
    const std::uint32_t absorber = add_absorber(scene, glm::vec3(0.25F));
    place_mesh(scene, add_mesh(scene, quad({-1.5F, -1.5F, 0}, {0, 3, 0}, {3, 0, 0}, absorber)));  // it faces the floor
    if (with_far_thing) {
      place_mesh(scene,
                 add_mesh(scene, quad({0, 0, 9}, {0.01F, 0, 0}, {0, 0.01F, 0}, add_material(scene, test::diffuse()))));
    }
    return sunlit_floor(std::move(scene));
  };
  EXPECT_NEAR(below_a_pane(false), 1.0, 0.04);
  EXPECT_NEAR(below_a_pane(true), 1.0, 0.04);

  // Half of the light passes each wall by: what passes the upper alone has come to the lower from without the scene.
  Scene scene;
  const std::uint32_t dark = add_absorber(scene, glm::vec3(1e-4F));
  scene.materials[dark].alpha_mode = AlphaMode::Blend;
  scene.materials[dark].base_color.a = 0.5F;
  add_box(scene, {-1.5F, -1.5F, 0}, {1.5F, 1.5F, 1}, dark);
  EXPECT_NEAR(sunlit_floor(std::move(scene)), 0.5, 0.02);
}

TEST(Medium, AnEyeOutsideSeesTheBackOfAWallUndimmed) {
  Scene scene;
  place_mesh(scene, add_mesh(scene, quad({-5, -5, 0}, {0, 10, 0}, {10, 0, 0}, add_absorber(scene, glm::vec3(0.5F)))));
  scene.environment = test::even_light({1.0F, 1.0F, 1.0F});
  expect_seen(glm::dvec3(1.0), 3.0, std::move(scene));
}

/// A box of 0.25 a metre in one of 0.5 a metre.
Scene nested() {
  Scene scene;
  add_box(scene, 1.5F, add_absorber(scene, glm::vec3(0.5F)));
  add_box(scene, 1.0F, add_absorber(scene, glm::vec3(0.25F)));
  return scene;
}

TEST(Medium, ASolidInAnotherTakesItsPlace) {
  Scene lit = nested();
  add_box(lit, 0.5F, add_material(lit, test::glowing(glm::vec3(1.0F))));
  expect_seen(glm::dvec3(std::pow(0.5, 0.5) * std::pow(0.25, 0.5)), 5.0, lit);
  expect_seen(glm::dvec3(std::pow(0.25, 0.25)), 0.75, lit);
  expect_seen(glm::dvec3(std::pow(0.5, 0.25) * std::pow(0.25, 0.5)), 1.25, lit);
}

TEST(Medium, BehindASolidTheOneAroundItGoesOn) {
  Scene scene = nested();
  add_box(scene, {-0.5F, -0.5F, -1.45F}, {0.5F, 0.5F, -1.25F}, add_material(scene, test::glowing(glm::vec3(1.0F))));
  expect_seen(glm::dvec3(std::pow(0.5, 0.75) * std::pow(0.25, 2.0)), 5.0, scene);
  expect_seen(glm::dvec3(std::pow(0.5, 0.25) * 0.25), 0.0, scene);
}

TEST(Medium, DimsNoNormals) {
  Scene scene;
  add_box(scene, 1.5F, add_absorber(scene, glm::vec3(0.5F)));
  add_box(scene, 0.5F, add_material(scene, test::diffuse()));
  finish_scene(scene);
  const View view = test::view_from({0.1, 0.07, 1.25}, {0.1, 0.07, 0.0}, {1, 1}, scene, 1e-4);
  const TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
  TileLayer<Rgb> color(keys.layout());
  TileLayer<Rgb> normal(keys.layout());
  DeferredShader shader(scene, {});
  shader.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &color, .normal = &normal});
  EXPECT_EQ(normal.at(0, 0, 0), (Rgb{0.0F, 0.0F, 1.0F}));
}

/// A lamp, a ball and the eye in water: it stands in a white room, or, as no ray of the reference finds a point light
/// through a wall of water, the room in it.
TEST(Medium, PassesAndReferenceShowTheSameRoomUnderWater) {
  for (const bool point_light : {false, true}) {
    Scene scene;
    const std::uint32_t white = add_material(scene, test::diffuse(glm::vec3(0.7F)));
    add_box(scene, 1.0F, white);
    add_box(scene, point_light ? 1.2F : 0.9F, add_absorber(scene, {0.9F, 0.6F, 0.3F}));
    place_mesh(scene, add_mesh(scene, test::sphere(0.3, 24, white)),
               glm::translate(glm::dmat4(1.0), {0.1, -0.3, -0.2}));
    if (point_light) {
      Light lamp;
      lamp.position = {0.1, 0.6, 0.2};
      scene.lights.push_back(lamp);
    } else {
      const std::uint32_t glow = add_material(scene, test::glowing({8.0F, 8.0F, 8.0F}));
      place_mesh(scene, add_mesh(scene, quad({-0.6F, 0.7F, -0.6F}, {1.2F, 0, 0}, {0, 0, 1.2F}, glow)));
    }
    finish_scene(scene);
    const View view = test::view_from({0, 0, 0.8}, {0, -0.3, -1}, {8, 8}, scene, 1.2);
    const auto mean = [&](const RaySettings& settings, std::uint32_t samples) {
      const TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
      DeferredShader shader(scene, settings);
      glm::dvec3 sum(0.0);
      for (std::uint32_t sample = 0; sample < samples; ++sample) {
        TileLayer<Rgb> radiance(keys.layout());
        shader.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &radiance}, {.sample = sample});
        for (int pixel = 0; pixel < 64; ++pixel) {
          const Rgb& color = radiance.at(0, pixel % 8, pixel / 8);
          sum += glm::dvec3(color.r, color.g, color.b);
        }
      }
      return sum / (64.0 * samples);
    };
    const glm::dvec3 reference = mean({.max_depth = 64, .terminator_fix = false, .reference = true}, 512);
    const glm::dvec3 hybrid =
        mean({.max_depth = 24, .photons = 20'000, .global_photons = true, .terminator_fix = false}, 16);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(hybrid[c] / reference[c], 1.0, 0.03) << point_light << ' ' << c;
  }
}

TEST(Medium, FindsTheSolidsAPlaceLiesIn) {
  Scene scene;
  const glm::vec3 half(0.5F);
  const double absorption = -std::log(0.5);
  const std::uint32_t water = add_absorber(scene, half);
  const std::uint32_t clear = add_material(scene, test::clear_glass(1.5F, 1.0F));
  const std::uint32_t ball = add_mesh(scene, test::sphere(1.0, 16, water));
  place_mesh(scene, ball);
  place_mesh(scene, ball, glm::translate(glm::dmat4(1.0), {1.0, 2.9, 0.8}));  // about on the line through the first
  place_mesh(scene, ball, glm::scale(glm::translate(glm::dmat4(1.0), {10, 0, 0}), {-2, 1, 1}));  // mirrored
  place_mesh(scene, ball, glm::scale(glm::translate(glm::dmat4(1.0), {20, 0, 0}), {1, 1, 0}));   // of no volume
  place_mesh(scene, add_mesh(scene, quad({-50, 30, -50}, {0, 0, 100}, {100, 0, 0}, water)));     // open, looks up
  place_mesh(scene, add_mesh(scene, test::sphere(0.2, 16, clear)), glm::translate(glm::dmat4(1.0), {-0.5, 0, 0}));
  finish_scene(scene);
  const MediumFinder finder(scene);
  EXPECT_TRUE(finder.absorbs());
  const auto expect_at = [&](const glm::dvec3& at, double here, double around) {
    const Media media = finder.at(at);
    EXPECT_NEAR(media.here.g, here, 1e-6) << at.x << ' ' << at.y << ' ' << at.z;
    EXPECT_NEAR(media.around.g, around, 1e-6) << at.x << ' ' << at.y << ' ' << at.z;
  };
  expect_at({0, 0, 0}, absorption, 0.0);
  expect_at({0, 0.97, 0}, absorption, 0.0);
  expect_at({1.0, 2.9, 0.8}, absorption, 0.0);
  expect_at({11.7, 0, 0.1}, absorption, 0.0);
  expect_at({-0.5, 0, 0}, 0.0, absorption);
  expect_at({0, 1.5, 0}, 0.0, 0.0);
  expect_at({0, -4, 0}, 0.0, 0.0);
  expect_at({20, 0, 0}, 0.0, 0.0);
  expect_at({100, 0, 0}, 0.0, 0.0);
  expect_at(glm::dvec3(std::numeric_limits<double>::quiet_NaN()), 0.0, 0.0);
  View view;
  EXPECT_NEAR(finder.of_eyes({&view, 1}).front().here.g, absorption, 1e-6);
  view.orthographic = true;
  EXPECT_EQ(finder.of_eyes({&view, 1}).front(), Media{});
}

TEST(Medium, IsNotLookedForWhereNothingAbsorbs) {
  Scene scene;
  place_mesh(scene, add_mesh(scene, test::sphere(1.0, 16, add_material(scene, test::clear_glass(1.5F, 1.0F)))));
  finish_scene(scene);
  EXPECT_FALSE(MediumFinder(scene).absorbs());
}

}  // namespace
}  // namespace hpr
