#include "rt/lights.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace hpr {
namespace {

Light lamp(LightType type) {
  Light light;
  light.type = type;
  light.intensity = {6.0F, 3.0F, 0.0F};
  return light;
}

TEST(Lights, APointLightFallsWithTheSquaredDistanceInsideItsRange) {
  Light light = lamp(LightType::Point);
  light.position = {0, 4, 0};
  const LightSample sample = sample_light(light, {3, 0, 0}, View{});
  EXPECT_NEAR(sample.distance, 5.0, 1e-14);
  EXPECT_NEAR(sample.irradiance.r, 6.0 / 25.0, 1e-14);
  EXPECT_NEAR(sample.to_light.y, 0.8, 1e-14);
  light.range = 10.0;
  EXPECT_NEAR(sample_light(light, {3, 0, 0}, View{}).irradiance.r, 6.0 / 25.0 * (1.0 - 0.0625), 1e-14);
  light.range = 5.0;
  EXPECT_EQ(sample_light(light, {3, 0, 0}, View{}).irradiance.r, 0.0);
}

TEST(Lights, ADirectionalLightIsTheSameEverywhere) {
  Light light = lamp(LightType::Directional);
  light.direction = {0, -1, 0};
  for (const double x : {0.0, 1e9}) {
    const LightSample sample = sample_light(light, {x, 0, 0}, View{});
    EXPECT_EQ(sample.to_light, glm::dvec3(0, 1, 0));
    EXPECT_EQ(sample.irradiance, glm::dvec3(6, 3, 0));
    EXPECT_TRUE(std::isinf(sample.distance));
  }
}

TEST(Lights, ASpotIsFullInsideItsInnerConeZeroOutsideTheOuterAndSquaredBetween) {
  Light light = lamp(LightType::Spot);
  light.inner_cone_radians = 0.2F;
  light.outer_cone_radians = 0.6F;
  const auto at = [&](double angle) {
    return sample_light(light, {std::sin(angle), 0.0, -std::cos(angle)}, View{}).irradiance.r;
  };
  EXPECT_NEAR(at(0.0), 6.0, 1e-12);
  EXPECT_NEAR(at(0.19), 6.0, 1e-12);
  EXPECT_EQ(at(0.61), 0.0);
  EXPECT_EQ(at(3.0), 0.0);
  const double ramp = (std::cos(0.4) - std::cos(0.6)) / (std::cos(0.2) - std::cos(0.6));
  EXPECT_NEAR(at(0.4), 6.0 * ramp * ramp, 1e-6);
}

TEST(Lights, ALightOnTheSurfaceOrAtInfinityGivesNothingRatherThanNan) {
  for (const LightType type : {LightType::Point, LightType::Spot, LightType::Headlight}) {
    Light light = lamp(type);
    EXPECT_EQ(sample_light(light, {0, 0, 0}, View{}).irradiance, glm::dvec3(0.0));
    light.position = glm::dvec3(1e300);
    EXPECT_EQ(sample_light(light, {-1e300, 0, 0}, View{}).irradiance.b, 0.0);
  }
  Light near = lamp(LightType::Point);
  EXPECT_TRUE(std::isfinite(sample_light(near, {1e-200, 0, 0}, View{}).irradiance.r));
}

TEST(Lights, ASceneWithoutLightsGetsAHeadlightNearTheEye) {
  const std::vector<Light> lights = lights_or_headlight(Scene{});
  ASSERT_EQ(lights.size(), 1U);
  EXPECT_FALSE(casts_shadows(lights[0]));
  View view;
  view.eye = {0, 0, 9};
  const LightSample sample = sample_light(lights[0], {0, 0, 0}, view);
  EXPECT_NEAR(glm::length(sample.to_light), 1.0, 1e-12);
  EXPECT_GT(sample.to_light.z, 0.85);  // of what the eye sees, little turns away from it
  EXPECT_LT(sample.to_light.z, 0.99);  // and not straight from it
  EXPECT_NEAR(sample.irradiance.r / std::numbers::pi, 1.0, 1e-6);
  Scene lit;
  lit.lights.resize(3);
  EXPECT_EQ(lights_or_headlight(lit).size(), 3U);
}

}  // namespace
}  // namespace hpr
