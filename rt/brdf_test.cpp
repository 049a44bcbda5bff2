#include "rt/brdf.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <random>

namespace hpr {
namespace {

constexpr glm::dvec3 kUp(0.0, 0.0, 1.0);

glm::dvec3 direction(double polar, double around) {
  return {std::sin(polar) * std::cos(around), std::sin(polar) * std::sin(around), std::cos(polar)};
}

/// What the surface reflects of uniform light of radiance 1: the midpoint rule over the hemisphere, fine enough for
/// roughness 0.4 and above.
double albedo(const Brdf& brdf, double viewer_polar) {
  constexpr int kPolar = 200;
  constexpr int kAround = 200;
  const glm::dvec3 viewer = direction(viewer_polar, 0.3);
  double sum = 0.0;
  for (int i = 0; i < kPolar; ++i) {
    const double polar = (i + 0.5) / kPolar * std::numbers::pi / 2.0;
    for (int j = 0; j < kAround; ++j) {
      const double around = (j + 0.5) / kAround * 2.0 * std::numbers::pi;
      sum += brdf.value(kUp, direction(polar, around), viewer).g * std::cos(polar) * std::sin(polar);
    }
  }
  return sum * (std::numbers::pi / 2.0 / kPolar) * (2.0 * std::numbers::pi / kAround);
}

Brdf metal(double roughness) {
  return {.base_color = glm::dvec3(0.5), .metallic = 1.0, .roughness = roughness};
}

/// The mean over all viewers, cosine-weighted: the share of a uniform hemisphere's light that leaves again.
double mean_albedo(const Brdf& brdf) {
  constexpr int kSteps = 16;
  double sum = 0.0;
  for (int i = 0; i < kSteps; ++i) sum += albedo(brdf, std::asin(std::sqrt((i + 0.5) / kSteps)));
  return sum / kSteps;
}

TEST(Brdf, AMetalNeverReflectsMoreLightThanArrives) {
  for (const double roughness : {0.4, 0.7, 1.0}) {
    for (const double polar : {0.0, 0.7, 1.3, 1.5}) {
      const Brdf white{.base_color = glm::dvec3(1.0), .metallic = 1.0, .roughness = roughness};
      EXPECT_LE(albedo(white, polar), 1.0 + 1e-3) << roughness << ' ' << polar;
    }
  }
}

// The specification's mix of layers lets a base whiter than this exceed 1, and single grazing viewers as well.
TEST(Brdf, ADielectricOfAlbedo95ReflectsNoMoreOfAFurnaceThanArrives) {
  for (const double roughness : {0.4, 0.7, 1.0}) {
    for (const double metallic : {0.0, 0.5}) {
      const Brdf white{.base_color = glm::dvec3(0.95), .metallic = metallic, .roughness = roughness};
      EXPECT_LE(mean_albedo(white), 1.0) << roughness << ' ' << metallic;
    }
  }
}

TEST(Brdf, AGreyMetalLosesInAFurnaceWhatSingleScatteringLoses) {
  // Mitsuba 3's value for the same distribution, roughness .5 and base colour .5.
  EXPECT_NEAR(mean_albedo(metal(0.5)), 0.459, 0.01);
}

TEST(Brdf, AWhiteLambertSurfaceReflectsEverything) {
  const Brdf white{.base_color = glm::dvec3(1.0), .metallic = 0.0, .roughness = 0.0, .dielectric_f0 = 0.0};
  EXPECT_NEAR(white.value(kUp, direction(0.5, 0.0), kUp).r, 1.0 / std::numbers::pi, 1e-3);
}

TEST(Brdf, IsTheSameWithLightAndViewerSwapped) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (int i = 0; i < 2000; ++i) {
    const Brdf brdf{.base_color = {uniform(random), uniform(random), uniform(random)},
                    .metallic = uniform(random),
                    .roughness = uniform(random)};
    const glm::dvec3 a = direction(1.57 * uniform(random), 6.28 * uniform(random));
    const glm::dvec3 b = direction(1.57 * uniform(random), 6.28 * uniform(random));
    const glm::dvec3 there = brdf.value(kUp, a, b);
    const glm::dvec3 back = brdf.value(kUp, b, a);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(there[c], back[c], 1e-12 * (1.0 + there[c]));
  }
}

TEST(Brdf, HasNoMirrorHighlightWhenPerfectlySmoothAndAFiniteOneWhenNearlySo) {
  EXPECT_EQ(metal(0.0).value(kUp, kUp, kUp), glm::dvec3(0.0));
  for (const double roughness : {1e-3, 1e-2, 0.1, 1.0}) {
    const double peak = metal(roughness).value(kUp, kUp, kUp).r;
    // D = 1 / (pi alpha^2), G = 1, 4 n.l n.v = 4.
    EXPECT_NEAR(peak / (0.5 / (4.0 * std::numbers::pi * std::pow(roughness, 4.0))), 1.0, 1e-9) << roughness;
  }
}

TEST(Brdf, LosesOfItsDiffuseLightWhatIsLetThrough) {
  const auto value = [](double transmission) {
    const Brdf brdf{.base_color = glm::dvec3(0.5), .roughness = 0.4, .transmission = transmission};
    return brdf.value(kUp, direction(0.4, 1.0), direction(0.7, 2.0)).g;
  };
  const double specular = value(1.0);
  EXPECT_GT(specular, 0.0);
  EXPECT_GT(value(0.0), 1.5 * specular);
  EXPECT_NEAR(value(0.25), specular + 0.75 * (value(0.0) - specular), 1e-12);
}

TEST(Brdf, AnIndexOfRefractionOfZeroReflectsEverything) {
  Material material;
  material.ior = 0.0F;
  EXPECT_EQ(evaluate_material(Scene{}, material, {}).brdf.dielectric_f0, 1.0);
  material.ior = 1.5F;
  EXPECT_NEAR(evaluate_material(Scene{}, material, {}).brdf.dielectric_f0, 0.04, 1e-12);
}

TEST(Brdf, IsZeroBehindTheSurfaceAndFiniteAtGrazingAngles) {
  for (const double roughness : {0.0, 1e-3, 0.5, 1.0}) {
    EXPECT_EQ(metal(roughness).value(kUp, -kUp, kUp), glm::dvec3(0.0));
    EXPECT_EQ(metal(roughness).value(kUp, kUp, direction(1.6, 0.0)), glm::dvec3(0.0));
    const double grazing = std::numbers::pi / 2.0 - 1e-9;
    const glm::dvec3 value = metal(roughness).value(kUp, direction(grazing, 0.0), direction(grazing, 3.0));
    EXPECT_TRUE(std::isfinite(value.r) && value.r >= 0.0) << roughness;
  }
}

TEST(Brdf, ReadsRoughnessFromGreenMetalFromBlueAndColourFromSrgb) {
  Scene scene;
  scene.textures.resize(2);
  scene.textures[0].image = Image<Rgba8>({1, 1}, Rgba8{188, 188, 188, 255});
  scene.textures[1].image = Image<Rgba8>({1, 1}, Rgba8{7, 51, 255, 255});
  Material material;
  material.base_color_texture.texture = 0;
  material.metallic_roughness_texture.texture = 1;
  material.emissive = glm::vec3(4.0F);
  material.emissive_texture.texture = 0;
  const MaterialPoint point = evaluate_material(scene, material, {});
  EXPECT_NEAR(point.brdf.base_color.r, 0.5029, 1e-3);
  EXPECT_NEAR(point.brdf.roughness, 0.2, 1e-12);
  EXPECT_NEAR(point.brdf.metallic, 1.0, 1e-12);
  EXPECT_NEAR(point.emission.g, 4.0 * 0.5029, 4e-3);
}

}  // namespace
}  // namespace hpr
