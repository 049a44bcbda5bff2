#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "rt/lights/triangle_lights.h"
#include "rt/reference/test_paths.h"
#include "rt/test_scene.h"

// Materials with one side: who looks from behind looks through, light does not pass.
namespace hpr {
namespace {

using test::add_material;
using test::add_mesh;
using test::place_mesh;
using test::quad;

Material one_sided(Material material) {
  material.double_sided = false;
  return material;
}

/// 10 m a side at a height, level; its front looks up or down.
void add_level_quad(Scene& scene, float height, const Material& material, bool looks_up) {
  const std::uint32_t index = add_material(scene, material);
  const glm::vec3 x(10, 0, 0);
  const glm::vec3 z(0, 0, 10);
  place_mesh(scene, add_mesh(scene, quad({-5, height, -5}, looks_up ? z : x, looks_up ? x : z, index)));
}

View down_from(double height, const Scene& scene) {
  return test::view_from({0, height, 0}, {0, 0, 0}, {3, 3}, scene, 1e-4, {0, 0, -1});
}

double pixel(const Scene& scene, const RaySettings& settings, std::uint32_t samples = 1) {
  return test::mean_pixel(scene, down_from(1.0, scene), 1, 1, samples, settings).g;
}

TEST(Sides, AMirrorShowsWhatLiesBehindTheBackOfASurface) {
  for (const bool looks_up : {false, true}) {
    for (const bool turned : {false, true}) {
      Scene scene;
      add_level_quad(scene, 0, test::mirror(1.0F), true);
      add_level_quad(scene, 2, one_sided(test::glowing(glm::vec3(2.0F))), looks_up);
      if (turned) scene.instances.back().to_world[0] *= -1.0;
      add_level_quad(scene, 3, test::glowing(glm::vec3(8.0F)), false);
      finish_scene(scene);
      const double expected = looks_up ? 8.0 : 2.0;
      EXPECT_NEAR(pixel(scene, {}), expected, 1e-6) << looks_up << turned;
      EXPECT_NEAR(pixel(scene, {.reference = true}), expected, 1e-6) << looks_up << turned;
    }
  }
}

TEST(Sides, ShadowsFallFromBothSides) {
  for (const bool looks_up : {false, true}) {
    Scene scene;
    add_level_quad(scene, 0, test::diffuse(), true);
    add_level_quad(scene, 2, one_sided(test::diffuse()), looks_up);
    Light sun;
    sun.type = LightType::Directional;
    sun.direction = {0.0F, -1.0F, 0.0F};
    scene.lights = {sun};
    finish_scene(scene);
    EXPECT_EQ(pixel(scene, {}), 0.0) << looks_up;
    // White walls light each other, but no light is between these.
    EXPECT_EQ(pixel(scene, {.reference = true}, 16), 0.0) << looks_up;
  }
}

/// What a white floor shows under a black ceiling close above it that the sky cannot pass.
double under_ceiling(const Material& ceiling, bool looks_up, const RaySettings& settings) {
  Scene scene;
  add_level_quad(scene, 0, test::diffuse(), true);
  add_level_quad(scene, 1.5F, ceiling, looks_up);
  scene.environment = test::even_light({1.0F, 1.0F, 1.0F});
  finish_scene(scene);
  return pixel(scene, settings, 512);
}

TEST(Sides, RaysThatGatherLightMeetBothSides) {
  const Material black = test::diffuse(glm::vec3(0.0F));
  for (const RaySettings& settings : {RaySettings{.reference = true}, RaySettings{.global_photons = true}}) {
    const double expected = under_ceiling(black, false, settings);
    EXPECT_GT(expected, 0.02);
    EXPECT_LT(expected, 0.2);
    for (const bool looks_up : {false, true}) {
      EXPECT_NEAR(under_ceiling(one_sided(black), looks_up, settings), expected, 1e-6) << settings.reference;
    }
  }
}

TEST(Sides, TheWallsOfAVolumeHaveBoth) {
  std::vector<Image<Rgb>> pictures;
  for (const bool double_sided : {false, true}) {
    Scene scene;
    Material glass = test::clear_glass(1.5F, 1.0F);
    glass.attenuation_color = {0.5F, 0.75F, 1.0F};
    glass.attenuation_distance = 1.0F;
    glass.double_sided = double_sided;
    place_mesh(scene, add_mesh(scene, test::sphere(1.0, 16, add_material(scene, glass))));
    add_level_quad(scene, -1.5F, test::glowing({0.5F, 1.0F, 2.0F}), true);
    scene.environment = test::even_light({0.25F, 0.25F, 0.25F});
    finish_scene(scene);
    const View view = test::view_from({3, 2, 1}, {0, 0, 0}, {24, 24}, scene, 0.9);
    pictures.push_back(test::shade(scene, view).image);
    pictures.push_back(test::shade(scene, view, {.reference = true}).image);
  }
  EXPECT_EQ(pictures[0], pictures[2]);
  EXPECT_EQ(pictures[1], pictures[3]);
}

TEST(Sides, FromWithinASolidTheBackOfWhatClosesItIsSeen) {
  Scene scene;
  // A block of glass without its lowest face, which is another material's, turned outwards as closed meshes are.
  const std::uint32_t glass = add_material(scene, test::clear_glass(1.5F, 1.0F));
  place_mesh(scene, add_mesh(scene, quad({-5, 0, -5}, {0, 0, 10}, {10, 0, 0}, glass)));
  Material base = one_sided(test::diffuse(glm::vec3(0.5F)));
  base.unlit = true;
  add_level_quad(scene, -1, base, false);
  add_level_quad(scene, -2, test::glowing(glm::vec3(64.0F)), true);
  finish_scene(scene);
  const double reflected = std::pow(0.5 / 2.5, 2.0);
  // Light that leaves a dense medium spreads: its radiance falls by the square of the index.
  const double expected = 0.5 * (1.0 - reflected) / (1.5 * 1.5);
  EXPECT_NEAR(pixel(scene, {}), expected, 1e-4);
  EXPECT_NEAR(pixel(scene, {.reference = true}, 4096), expected, 0.02 * expected);
}

/// A grey floor under a square light of one side that looks down or up.
Scene lit_floor(bool looks_up, bool double_sided) {
  Scene scene;
  add_level_quad(scene, 0, test::diffuse(glm::vec3(0.5F)), true);
  Material light = test::glowing(glm::vec3(3.0F));
  light.double_sided = double_sided;
  add_level_quad(scene, 2, light, looks_up);
  finish_scene(scene);
  return scene;
}

TEST(Sides, ASurfaceWithOneSideEmitsFromItAlone) {
  const Scene both = lit_floor(false, true);
  const Scene down = lit_floor(false, false);
  const Scene up = lit_floor(true, false);
  for (const RaySettings& settings : {RaySettings{}, RaySettings{.reference = true}}) {
    const double lit = pixel(both, settings, 256);
    EXPECT_GT(lit, 0.5);
    EXPECT_NEAR(pixel(down, settings, 256), lit, 0.05 * lit);
    EXPECT_EQ(pixel(up, settings, 16), 0.0);
  }
}

TEST(Sides, BothTechniquesOfTheReferenceAgreeOnALightOfOneSide) {
  const Scene scene = lit_floor(false, false);
  const test::PathBench bench(scene);
  const View view = down_from(1.0, scene);
  const test::Estimate lights = test::estimate(bench, view, {.technique = Technique::Lights}, 16, 32);
  const test::Estimate surfaces = test::estimate(bench, view, {.technique = Technique::Surfaces}, 16, 32);
  EXPECT_LT(std::hypot(lights.error, surfaces.error), 0.05 * lights.mean);
  EXPECT_NEAR(lights.mean, surfaces.mean, 4.0 * std::hypot(lights.error, surfaces.error));
}

TEST(Sides, PhotonsOfALightOfOneSideStartOnItWithHalfThePower) {
  for (const bool turned : {false, true}) {
    Scene scene = lit_floor(false, false);
    if (turned) scene.instances.back().to_world[0] *= -1.0;
    const TriangleLights lights(scene);
    ASSERT_EQ(lights.size(), 2U);
    EXPECT_NEAR(lights.power(0).g, std::numbers::pi * 50.0 * 3.0, 1e-6);
    for (const double u : {0.1, 0.9}) {
      const PhotonStart start = lights.emit(0, u, {0.3, 0.4}, {0.5, 0.6});
      EXPECT_LT(start.direction.y, 0.0) << u;  // reflected along x, the quad looks where it did
      EXPECT_NEAR(start.flux.g, std::numbers::pi * 50.0 * 3.0, 1e-6);
    }
  }
}

}  // namespace
}  // namespace hpr
