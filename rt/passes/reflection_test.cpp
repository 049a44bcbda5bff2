#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "rt/deferred_shader.h"
#include "rt/materials/bsdf.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

using test::add_material;
using test::add_mesh;
using test::place_mesh;
using test::quad;

TEST(Reflection, AMirrorShowsTheColourOfWhatItReflectsTimesItsReflectance) {
  Scene scene;
  add_material(scene, test::mirror(0.25F));
  add_material(scene, test::glowing({3.0F, 0.5F, 0.125F}));
  place_mesh(scene, add_mesh(scene, quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, 0)));
  place_mesh(scene, add_mesh(scene, quad({-50, 10, -50}, {100, 0, 0}, {0, 0, 100}, 1)));
  finish_scene(scene);
  const View view = test::view_from({0, 3, 0}, {0, 0, 0}, {5, 5}, scene, 1e-4, {0, 0, -1});
  const test::Shaded lit = test::shade(scene, view);
  // The headlight is hidden in the mirror lobe: only the image of the glowing quad is seen.
  EXPECT_NEAR(lit.image.at(2, 2).r, 0.75F, 1e-6F);
  EXPECT_NEAR(lit.image.at(2, 2).g, 0.125F, 1e-6F);
  EXPECT_NEAR(lit.image.at(2, 2).b, 0.03125F, 1e-6F);
  const test::Shaded off = test::shade(scene, view, {.passes = {PassId::Shadow}});
  EXPECT_EQ(off.image.at(2, 2), Rgb{});
}

/// A mirror whose normals pretend that it leans towards a glowing wall on its right, seen from above on the left.
test::Shaded leaning_mirror(const glm::dvec3& to_viewer) {
  Scene scene;
  add_material(scene, test::mirror(0.5F));
  add_material(scene, test::glowing(glm::vec3(2.0F)));
  Mesh mirror = quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, 0);
  mirror.normals.assign(4, glm::vec3(std::sin(0.7F), std::cos(0.7F), 0.0F));
  place_mesh(scene, add_mesh(scene, mirror));
  place_mesh(scene, add_mesh(scene, quad({10, -50, -50}, {0, 100, 0}, {0, 0, 100}, 1)));
  finish_scene(scene);
  return test::shade(scene, test::view_from(3.0 * to_viewer, {0, 0, 0}, {3, 3}, scene, 1e-4));
}

double reflected_by_half(double cosine) {
  return 2.0 * (0.5 + 0.5 * std::pow(1.0 - cosine, 5.0));
}

TEST(Reflection, AMirrorImageThatASmoothNormalSendsInsideIsBentBackAbove) {
  const glm::dvec3 to_viewer = glm::normalize(glm::dvec3(-0.5, 0.866, 0.0));
  const test::Shaded lit = leaning_mirror(to_viewer);
  EXPECT_EQ(lit.counts[PassId::Reflection], 9U) << "one ray a pixel: none of them meets the mirror again";
  const double cosine = glm::dot(to_viewer, glm::dvec3(std::sin(0.7), std::cos(0.7), 0.0));
  EXPECT_NEAR(lit.image.at(1, 1).r, reflected_by_half(cosine), 1e-4);
}

TEST(Reflection, AMirrorWhoseSmoothNormalTurnsAwayReflectsByItsGeometricOne) {
  const glm::dvec3 to_viewer = glm::normalize(glm::dvec3(-0.94, 0.342, 0.0));
  const test::Shaded lit = leaning_mirror(to_viewer);
  EXPECT_EQ(lit.counts[PassId::Reflection], 9U);
  EXPECT_NEAR(lit.image.at(1, 1).r, reflected_by_half(to_viewer.y), 1e-4);
}

/// A grey metal under an even sky, and the share of the sky's light it reflects by theory: what its lobe's samples
/// weigh.
struct Furnace {
  double seen = 0.0;
  double expected = 0.0;
};
Furnace furnace(float roughness, const RaySettings& settings) {
  Scene scene;
  Material material = test::mirror(1.0F);
  material.roughness = roughness;
  add_material(scene, material);
  place_mesh(scene, add_mesh(scene, quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, 0)));
  scene.environment = test::even_light({1.0F, 1.0F, 1.0F});
  finish_scene(scene);
  const View view = test::view_from({2, 2, 0}, {0, 0, 0}, {1, 1}, scene, 1e-4);
  SurfacePoint point;
  point.to_viewer = glm::normalize(glm::dvec3(1, 1, 0));
  point.geometric_normal = point.shading_normal = {0, 1, 0};
  MaterialPoint metal;
  metal.metallic = 1.0;
  metal.roughness = roughness;
  metal.normal = {0, 1, 0};
  const Bsdf bsdf(metal, point);
  constexpr std::uint32_t kSamples = 4096;
  Furnace result;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    Sampler sampler(99, i);
    if (const auto sample = bsdf.sample(Lobe::Reflection, sampler.two()))
      result.expected += sample->weight.r / kSamples;
  }
  result.seen = test::mean_pixel(scene, view, 0, 0, kSamples, settings).r;
  return result;
}

TEST(Reflection, ABlurredMirrorImageIsTheMeanOverItsLobe) {
  for (const float roughness : {0.0F, 5e-4F, 0.1F, 0.29F, 0.3F, 0.6F, 1.0F}) {
    const Furnace followed = furnace(roughness, {.glossy_cutoff = 2.0});
    EXPECT_NEAR(followed.seen / followed.expected, 1.0, 3e-3) << roughness << ", followed by rays";
    if (roughness < 0.25F) continue;  // too narrow to be found from the light's side
    const Furnace sampled = furnace(roughness, {.glossy_cutoff = 0.0});
    EXPECT_NEAR(sampled.seen / sampled.expected, 1.0, 0.03) << roughness << ", by light samples";
  }
}

TEST(Reflection, AMirrorThatFacesNothingShowsTheBackground) {
  Scene scene;
  add_material(scene, test::mirror(0.5F));
  place_mesh(scene, add_mesh(scene, quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, 0)));
  scene.background = {0.5F, 1.0F, 2.0F};
  finish_scene(scene);
  const View view = test::view_from({0, 3, 0}, {0, 0, 0}, {65, 65}, scene, 1.2, {0, 0, -1});
  const test::Shaded lit = test::shade(scene, view);
  EXPECT_NEAR(lit.image.at(32, 32).b, 1.0F, 1e-5F);
  EXPECT_EQ(lit.image.at(0, 0), (Rgb{0.5F, 1.0F, 2.0F}));
}

TEST(Reflection, TwoFacingMirrorsSumTheirGeometricSeriesUpToTheDepth) {
  constexpr double kRho = 0.75;
  Scene scene;
  Material glowing_mirror = test::mirror(static_cast<float>(kRho));
  glowing_mirror.emissive = glm::vec3(1.0F);
  add_material(scene, glowing_mirror);
  place_mesh(scene, add_mesh(scene, quad({-50, 0, 50}, {100, 0, 0}, {0, 0, -100}, 0)));
  place_mesh(scene, add_mesh(scene, quad({-50, 4, -50}, {100, 0, 0}, {0, 0, 100}, 0)));
  finish_scene(scene);
  const View view = test::view_from({0, 2, 0}, {0, 0, 0}, {3, 3}, scene, 1e-6, {0, 0, -1});
  for (const int depth : {0, 1, 2, 7, 40}) {
    const test::Shaded lit = test::shade(scene, view, {.max_depth = depth});
    const double expected = (1.0 - std::pow(kRho, depth + 1)) / (1.0 - kRho);
    EXPECT_NEAR(lit.image.at(1, 1).r, expected, 1e-4) << depth;
    EXPECT_GE(lit.counts[PassId::Reflection], 9U * static_cast<unsigned>(std::min(depth, 38))) << depth;
    EXPECT_LE(lit.counts[PassId::Reflection], 9U * static_cast<unsigned>(depth))
        << depth;  // 0.75^39 leaves it to roulette
  }
}

TEST(Reflection, ADimMirrorShowsWhatIsBrightEnough) {
  Scene scene;
  add_material(scene, test::mirror(1e-7F));
  add_material(scene, test::glowing(glm::vec3(1e6F)));
  place_mesh(scene, add_mesh(scene, quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, 0)));
  place_mesh(scene, add_mesh(scene, quad({-50, 4, -50}, {100, 0, 0}, {0, 0, 100}, 1)));
  finish_scene(scene);
  const View view = test::view_from({0, 2, 0}, {0, 0, 0}, {64, 64}, scene, 0.1, {0, 0, -1});
  double sum = 0.0;
  constexpr std::uint32_t kSamples = 16;
  for (std::uint32_t sample = 0; sample < kSamples; ++sample) {
    const test::Shaded lit = test::shade(scene, view, {.seed = sample + 1});
    for (int y = 0; y < 64; ++y) {
      for (int x = 0; x < 64; ++x) sum += lit.image.at(x, y).r;
    }
  }
  // 429 of the 65 536 paths are to live; four standard deviations.
  EXPECT_NEAR(sum / (kSamples * 64.0 * 64.0), 0.1, 0.02);
}

TEST(Reflection, WhatAMirrorShowsIsLitAndShadowed) {
  // The eye sees, by a mirror, a floor whose light is blocked on one half.
  Scene scene;
  add_material(scene, test::diffuse());
  add_material(scene, test::mirror(1.0F));
  place_mesh(scene, add_mesh(scene, quad({-4, 0, 4}, {8, 0, 0}, {0, 0, -8}, 0)));
  place_mesh(scene, add_mesh(scene, quad({-4, 0, -4}, {8, 0, 0}, {0, 8, 0}, 1)));
  place_mesh(scene, add_mesh(scene, quad({0, 1, 4}, {4, 0, 0}, {0, 0, -8}, 0)));
  finish_scene(scene);
  Light sun;
  sun.type = LightType::Directional;
  sun.direction = {0.0F, -1.0F, 0.0F};
  scene.lights = {sun};
  const View view = test::view_from({0, 0.5, 3}, {0, 0.2, -4}, {64, 64}, scene, 0.3);
  const test::Shaded lit = test::shade(scene, view);
  // Seen at a slant, a little of the light goes to the specular layer.
  EXPECT_NEAR(lit.image.at(20, 34).r, 1.0 / std::numbers::pi, 1e-3);
  EXPECT_EQ(lit.image.at(44, 34).r, 0.0F);
}

}  // namespace
}  // namespace hpr
