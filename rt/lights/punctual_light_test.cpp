#include "rt/lights/punctual_light.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <numbers>

#include "rt/sampling/sampler.h"

namespace hpr {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr std::uint32_t kSamples = 16384;

Light sphere(const glm::dvec3& position, double radius) {
  Light light;
  light.position = position;
  light.radius = radius;
  light.intensity = {6.0F, 3.0F, 0.0F};
  return light;
}

/// On a plane through the origin with normal +z.
double estimated_irradiance(const Light& light) {
  double sum = 0.0;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const LightSample sample = sample_punctual(light, glm::dvec3(0.0), View{}, Sampler(1, i).two());
    sum += sample.weight.r * std::max(0.0, sample.to_light.z);
  }
  return sum / kSamples;
}

/// The irradiance of a sphere light by a grid over the sphere's cone; radiance is I / (pi r^2).
double exact_irradiance(const Light& light) {
  const double distance = glm::length(light.position);
  const glm::dvec3 axis = light.position / distance;
  const glm::dvec3 across = glm::normalize(glm::cross(axis, glm::dvec3(0.3, 0.9, 0.1)));
  const glm::dvec3 along = glm::cross(axis, across);
  const double edge = std::cos(std::asin(light.radius / distance));
  constexpr int kGrid = 1000;
  double sum = 0.0;
  for (int i = 0; i < kGrid; ++i) {
    const double cosine = 1.0 - (1.0 - edge) * (i + 0.5) / kGrid;
    const double sine = std::sqrt(1.0 - cosine * cosine);
    for (int j = 0; j < kGrid; ++j) {
      const double angle = 2.0 * kPi * (j + 0.5) / kGrid;
      const glm::dvec3 w = cosine * axis + sine * (std::cos(angle) * across + std::sin(angle) * along);
      sum += std::max(0.0, w.z);
    }
  }
  const double radiance = static_cast<double>(light.intensity.r) / (kPi * light.radius * light.radius);
  return radiance * sum * 2.0 * kPi * (1.0 - edge) / (kGrid * kGrid);
}

TEST(SphereLight, AboveTheHorizonItGivesWhatItsMiddleWould) {
  for (const double radius : {1e-6, 0.01, 0.5, 1.9}) {
    const glm::dvec3 position(1.0, -2.0, 2.0);
    EXPECT_NEAR(estimated_irradiance(sphere(position, radius)), 6.0 / 9.0 * (2.0 / 3.0), 1e-3) << radius;
  }
}

TEST(SphereLight, PartlyBelowTheHorizonItGivesWhatAGridOverItsConeSays) {
  for (const glm::dvec3 position : {glm::dvec3(2, 0, 0), glm::dvec3(2, 0, 0.5), glm::dvec3(1, -2, -0.7)}) {
    const Light light = sphere(position, 1.0);
    EXPECT_NEAR(estimated_irradiance(light) / exact_irradiance(light), 1.0, 5e-3) << position.z;
  }
}

TEST(SphereLight, AMillionRadiiAwayNothingCancels) {
  const glm::dvec3 axis = glm::normalize(glm::dvec3(1, 2, 3));
  const double distance = 1e6;
  const Light light = sphere(distance * axis, 1.0);
  double spread = 0.0;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const LightSample sample = sample_punctual(light, glm::dvec3(0.0), View{}, Sampler(2, i).two());
    EXPECT_NEAR(sample.weight.r * distance * distance / 6.0, 1.0, 1e-12);
    EXPECT_NEAR(glm::distance(sample.goal, light.position), 1.0, 1e-6) << "on the sphere";
    EXPECT_LE(sample.distance, distance);
    const glm::dvec3 off = sample.to_light - axis;
    spread += glm::dot(off, off) * distance * distance;
  }
  EXPECT_NEAR(spread / kSamples, 0.5, 0.01) << "uniform over the disc it is seen as";
}

TEST(SphereLight, HugeOrTinyOrTouchingItStaysFinite) {
  EXPECT_NEAR(estimated_irradiance(sphere({0, 0, 1e6 + 1.0}, 1e6)) * 1e12 / 6.0, 1.0, 1e-2);
  EXPECT_NEAR(estimated_irradiance(sphere({0, 0, 1}, 1e-6)) / 6.0, 1.0, 1e-6);
  EXPECT_NEAR(estimated_irradiance(sphere({0, 0, 1.0 + 1e-12}, 1.0)) / 6.0, 1.0, 1e-2);
}

TEST(SphereLight, InsideAndOnItThereIsNoLight) {
  for (const glm::dvec3 position : {glm::dvec3(0.0), glm::dvec3(0.5, 0, 0), glm::dvec3(1, 0, 0)}) {
    const LightSample sample = sample_punctual(sphere(position, 1.0), glm::dvec3(0.0), View{}, {0.5, 0.5});
    EXPECT_EQ(sample.weight, glm::dvec3(0.0));
  }
}

TEST(SphereLight, EndsAtItsRangeAndOutsideItsCone) {
  Light light = sphere({0, 0, 4}, 1.0);
  light.range = 4.0;
  EXPECT_EQ(estimated_irradiance(light), 0.0);
  light.range = 0.0;
  light.type = LightType::Spot;
  light.direction = {0, 0, 1};
  EXPECT_EQ(estimated_irradiance(light), 0.0);
  light.direction = {0, 0, -1};
  light.inner_cone_radians = 0.5F;  // the sphere is seen under less
  EXPECT_NEAR(estimated_irradiance(light), 6.0 / 16.0, 1e-3);
}

TEST(SunLight, AnyAngularRadiusGivesItsIrradianceToAFacingPlane) {
  Light light;
  light.type = LightType::Directional;
  light.direction = {0, 0, -1};
  light.intensity = glm::vec3(2.0F);
  for (const float radius : {0.0F, 1e-6F, 0.00465F, 0.8F, 1.5707963F, 3.0F}) {
    light.angular_radius_radians = radius;
    EXPECT_EQ(is_fixed(light), radius == 0.0F);
    EXPECT_NEAR(estimated_irradiance(light), 2.0, 2e-3) << radius;
  }
}

/// Means over a light's photons.
struct Moments {
  glm::dvec3 flux{0.0};
  glm::dvec3 direction{0.0};
  glm::dvec3 squared{0.0};
  glm::dvec3 origin_squared{0.0};
  double cosine = 0.0;  ///< between direction and where the photon leaves a sphere
};

Moments moments_of(const Light& light, const LitSphere& lit) {
  Moments mean;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    Sampler sampler(5, i);
    const glm::dvec2 u_place = sampler.two();
    const PhotonStart photon = emit_punctual(light, lit, u_place, sampler.two());
    EXPECT_NEAR(glm::length(photon.direction), 1.0, 1e-12);
    const glm::dvec3 from_center = photon.origin - light.position;
    mean.flux += photon.flux;
    mean.direction += photon.direction;
    mean.squared += photon.direction * photon.direction;
    mean.origin_squared += from_center * from_center;
    mean.cosine += glm::dot(photon.direction, from_center);
  }
  const double all = kSamples;
  return {mean.flux / all, mean.direction / all, mean.squared / all, mean.origin_squared / all, mean.cosine / all};
}

TEST(Photons, OfAPointLightLeaveItTheSameInAllDirections) {
  const Moments mean = moments_of(sphere({1, 2, 3}, 0.0), {});
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(mean.direction[axis], 0.0, 2e-3);
    EXPECT_NEAR(mean.squared[axis], 1.0 / 3.0, 2e-3);
    EXPECT_EQ(mean.origin_squared[axis], 0.0);
  }
  EXPECT_NEAR(mean.flux.g, 4.0 * kPi * 3.0, 1e-9);
}

TEST(Photons, OfASphereStartUniformlyOnItWithACosineLobe) {
  const Moments mean = moments_of(sphere({1, 2, 3}, 2.0), {});
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(mean.squared[axis], 1.0 / 3.0, 2e-3);
    EXPECT_NEAR(mean.origin_squared[axis], 4.0 / 3.0, 1e-2);
  }
  EXPECT_NEAR(mean.cosine, 2.0 * 2.0 / 3.0, 5e-3) << "the mean cosine of a cosine lobe is 2/3, the radius 2";
  EXPECT_NEAR(mean.flux.r, 4.0 * kPi * 6.0, 1e-9);
}

TEST(Photons, OfASpotFollowItsRamp) {
  Light light = sphere({0, 0, 0}, 0.0);
  light.type = LightType::Spot;
  light.inner_cone_radians = 0.2F;
  light.outer_cone_radians = 0.7F;
  constexpr int kRings = 16;
  std::array<double, kRings> found{};
  const double edge = std::cos(static_cast<double>(light.outer_cone_radians));
  glm::dvec3 flux(0.0);
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    Sampler sampler(6, i);
    const PhotonStart photon = emit_punctual(light, {}, {}, sampler.two());
    const double fraction = (1.0 + photon.direction.z) / (1.0 - edge);  // the light shines along -z
    ASSERT_LT(fraction, 1.0 + 1e-9);
    found[std::min(static_cast<std::size_t>(fraction * kRings), found.size() - 1)] += photon.flux.r / kSamples;
  }
  for (int ring = 0; ring < kRings; ++ring) {
    // W/sr as the direct light has it, over a ring of equal solid angle.
    double expected = 0.0;
    for (int part = 0; part < 64; ++part) {
      const double cosine = 1.0 - (1.0 - edge) * (ring + (part + 0.5) / 64.0) / kRings;
      const glm::dvec3 position(std::sqrt(1.0 - cosine * cosine), 0.0, -cosine);
      expected += sample_punctual(light, position, View{}, {}).weight.r * 2.0 * kPi * (1.0 - edge) / kRings / 64.0;
    }
    EXPECT_NEAR(found[static_cast<std::size_t>(ring)], expected, 0.005) << ring;
  }
}

TEST(Photons, OfTheSunCrossTheSceneEvenly) {
  Light light;
  light.type = LightType::Directional;
  light.direction = glm::normalize(glm::vec3(1, -2, 0.5));
  light.intensity = glm::vec3(3.0F);
  const LitSphere lit{{10, 20, 30}, 2.0};
  double inside = 0.0;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    Sampler sampler(8, i);
    const glm::dvec2 u = sampler.two();
    const PhotonStart photon = emit_punctual(light, lit, u, sampler.two());
    const glm::dvec3 offset = photon.origin - lit.center;
    EXPECT_NEAR(glm::dot(offset, photon.direction), -2.0, 1e-6);
    const double off = glm::length(offset - glm::dot(offset, photon.direction) * photon.direction);
    EXPECT_LE(off, 2.0 + 1e-6);
    if (off < 1.0) inside += photon.flux.r / kSamples;
  }
  EXPECT_NEAR(inside, 3.0 * kPi, 0.05) << "W/m^2 through the inner disc of a square metre times pi";
}

}  // namespace
}  // namespace hpr
