#include "rt/lights/light_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <numbers>
#include <vector>

#include "rt/sampling/sampler.h"

namespace hpr {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr glm::dvec3 kNoNormal(0.0);

glm::dvec3 random_direction(Sampler& sampler) {
  const glm::dvec2 u = sampler.two();
  const double z = 1.0 - 2.0 * u.x;
  const double across = std::sqrt(1.0 - z * z);
  return {across * std::cos(2.0 * kPi * u.y), across * std::sin(2.0 * kPi * u.y), z};
}

/// Points, spots and two-sided patches in a cube of side 2.
std::vector<LightBounds> random_lights(std::uint32_t count, std::uint64_t stream) {
  std::vector<LightBounds> lights(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    Sampler sampler(stream, i);
    LightBounds& light = lights[i];
    const glm::dvec2 u = sampler.two();
    light.low = glm::dvec3(2.0 * u.x - 1.0, 2.0 * u.y - 1.0, 2.0 * sampler.one() - 1.0);
    light.high = light.low;
    light.axis = random_direction(sampler);
    light.strength = 0.1 + sampler.one();
    light.spread_radians = i % 3 == 0 ? kPi : 0.0;
    light.two_sided = i % 3 == 1;
    if (i % 3 == 2) light.emission_radians = 0.6;
    if (i % 3 == 1) light.high += glm::dvec3(0.05 * sampler.one(), 0.05, 0.02);
  }
  return lights;
}

/// What a light without extent gives, which importance must not take for none.
double irradiance(const LightBounds& light, const glm::dvec3& position, const glm::dvec3& normal) {
  const glm::dvec3 offset = light.low - position;
  const double distance = glm::length(offset);
  const glm::dvec3 to_light = offset / distance;
  double cosine = normal == kNoNormal ? 1.0 : std::max(0.0, glm::dot(normal, to_light));
  if (light.spread_radians < kPi) {
    const double off = -glm::dot(light.axis, to_light);
    const double leaving = light.two_sided ? std::abs(off) : off;
    cosine *= leaving > std::cos(light.emission_radians) ? std::max(0.0, leaving) : 0.0;
  }
  return light.strength * cosine / (distance * distance);
}

std::vector<double> probabilities(const LightTree& tree, std::size_t lights, const glm::dvec3& position,
                                  const glm::dvec3& normal) {
  std::vector<double> found(lights);
  for (std::size_t i = 0; i < lights; ++i) found[i] = tree.probability(position, normal, i);
  return found;
}

double sum_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum;
}

TEST(LightTree, ProbabilitiesOfLightsThatShineEverywhereSumToOne) {
  for (const std::uint32_t count : {1U, 2U, 3U, 100U, 3000U}) {
    std::vector<LightBounds> lights = random_lights(count, 1);
    for (LightBounds& light : lights) light.spread_radians = kPi;
    const LightTree tree(lights);
    for (const glm::dvec3 position : {glm::dvec3(0.0), glm::dvec3(3, 0, 0), glm::dvec3(-50, 20, 9)}) {
      EXPECT_NEAR(sum_of(probabilities(tree, count, position, kNoNormal)), 1.0, 1e-9) << count;
    }
  }
}

TEST(LightTree, ChoosesAsOftenAsItsProbabilitiesSayAndTellsThemTheSame) {
  constexpr std::uint32_t kSamples = 40'000;
  const std::vector<LightBounds> lights = random_lights(50, 2);
  const LightTree tree(lights);
  const glm::dvec3 position(0.9, 1.4, -0.3);
  const glm::dvec3 normal = glm::normalize(glm::dvec3(-1, -1, 0.2));
  const std::vector<double> expected = probabilities(tree, lights.size(), position, normal);
  std::vector<double> found(lights.size(), 0.0);
  double none = 0.0;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const auto choice = tree.choose(position, normal, Sampler(3, i).one());
    if (!choice) {
      ++none;
      continue;
    }
    ASSERT_EQ(choice->probability, expected[choice->light]);
    ++found[choice->light];
  }
  EXPECT_NEAR(sum_of(expected), 1.0 - none / kSamples, 1e-3);
  for (std::size_t i = 0; i < lights.size(); ++i) {
    EXPECT_NEAR(found[i], kSamples * expected[i], 5.0 * std::sqrt(kSamples * expected[i]) + 1.0) << i;
  }
}

TEST(LightTree, NeverRulesOutALightThatReachesThePlace) {
  constexpr std::uint32_t kLights = 400;
  std::vector<LightBounds> lights = random_lights(kLights, 4);
  for (LightBounds& light : lights) light.high = light.low;
  const LightTree tree(lights);
  int reached = 0;
  for (std::uint32_t i = 0; i < 200; ++i) {
    Sampler sampler(5, i);
    const glm::dvec3 position = 2.5 * sampler.one() * random_direction(sampler);
    const glm::dvec3 normal = random_direction(sampler);
    for (std::size_t light = 0; light < kLights; ++light) {
      if (!(irradiance(lights[light], position, normal) > 0.0)) continue;
      ++reached;
      EXPECT_GT(tree.probability(position, normal, light), 0.0);
    }
  }
  EXPECT_GT(reached, 10'000);
}

TEST(LightTree, TheEstimateOverFiveThousandLightsIsTheirSum) {
  constexpr std::uint32_t kLights = 5000;
  constexpr std::uint32_t kSamples = 100'000;
  std::vector<LightBounds> lights = random_lights(kLights, 6);
  for (LightBounds& light : lights) light.high = light.low;
  const LightTree tree(lights);
  for (const glm::dvec3 position : {glm::dvec3(1.5, 0.2, 0.1), glm::dvec3(-1.2, -1.2, 1.2)}) {
    const glm::dvec3 normal = -glm::normalize(position);
    double exact = 0.0;
    for (const LightBounds& light : lights) exact += irradiance(light, position, normal);
    double sum = 0.0;
    double squares = 0.0;
    for (std::uint32_t i = 0; i < kSamples; ++i) {
      const auto choice = tree.choose(position, normal, Sampler(7, i).one());
      const double value = choice ? irradiance(lights[choice->light], position, normal) / choice->probability : 0.0;
      sum += value;
      squares += value * value;
    }
    const double mean = sum / kSamples;
    const double deviation = std::sqrt((squares / kSamples - mean * mean) / kSamples);
    EXPECT_NEAR(mean, exact, 4.0 * deviation);
    EXPECT_LT(deviation, 0.02 * exact);
  }
}

TEST(LightTree, InALongCorridorItVariesFarLessThanUniformChoice) {
  constexpr std::uint32_t kLights = 1000;
  std::vector<LightBounds> lights(kLights);
  for (std::uint32_t i = 0; i < kLights; ++i) {
    lights[i].low = lights[i].high = glm::dvec3(2.0 * i, 3.0, 0.0);
    lights[i].strength = 1.0;
    lights[i].spread_radians = kPi;
  }
  const LightTree tree(lights);
  const glm::dvec3 position(777.0, 0.0, 0.3);
  const glm::dvec3 normal(0, 1, 0);
  double exact = 0.0;
  double of_tree = 0.0;
  double uniform = 0.0;
  for (std::size_t i = 0; i < kLights; ++i) {
    const double value = irradiance(lights[i], position, normal);
    exact += value;
    of_tree += value * value / tree.probability(position, normal, i);
    uniform += value * value * kLights;
  }
  EXPECT_LT(of_tree - exact * exact, 2.5 * exact * exact);
  EXPECT_GT(uniform - exact * exact, 50.0 * (of_tree - exact * exact));
}

TEST(LightTree, LightsInOnePlaceAndInGeometricRowsMakeNoEndlessTree) {
  constexpr std::size_t kLights = 1000;
  std::vector<LightBounds> lights(kLights);
  for (LightBounds& light : lights) {
    light.strength = 1.0;
    light.spread_radians = kPi;
  }
  const LightTree same(lights);
  EXPECT_NEAR(sum_of(probabilities(same, kLights, {1, 0, 0}, kNoNormal)), 1.0, 1e-9);
  EXPECT_FALSE(same.choose({0, 0, 0}, kNoNormal, 0.5)) << "a light on the place gives nothing";
  for (std::size_t i = 0; i < kLights; ++i) {
    lights[i].low = lights[i].high = glm::dvec3(std::exp2(-static_cast<double>(i)), 0, 0);
  }
  const LightTree row(lights);
  EXPECT_NEAR(sum_of(probabilities(row, kLights, {-1, 0, 0}, kNoNormal)), 1.0, 1e-9);
}

TEST(LightTree, LightsOutOfReachOrBehindTheSurfaceAreNotChosen) {
  std::vector<LightBounds> lights(2);
  for (std::size_t i = 0; i < 2; ++i) {
    lights[i].low = lights[i].high = glm::dvec3(0, 0, i == 0 ? 1.0 : -1.0);
    lights[i].strength = 1.0;
    lights[i].spread_radians = kPi;
    lights[i].reach = 3.0;
  }
  const LightTree tree(lights);
  EXPECT_EQ(tree.probability(glm::dvec3(0.0), {0, 0, 1}, 0), 1.0);
  EXPECT_EQ(tree.probability(glm::dvec3(0.0), {0, 0, 1}, 1), 0.0);
  EXPECT_NEAR(tree.probability(glm::dvec3(0.0), kNoNormal, 1), 0.5, 1e-12);
  EXPECT_FALSE(tree.choose({9, 0, 0}, kNoNormal, 0.5));
  EXPECT_FALSE(tree.choose({1e300, 0, 0}, kNoNormal, 0.5));
  EXPECT_FALSE(LightTree(std::span<const LightBounds>()).choose({0, 0, 0}, kNoNormal, 0.5));
}

TEST(LightBounds, OfManyNormalsHoldEveryOneOfThem) {
  for (std::uint32_t i = 0; i < 300; ++i) {
    Sampler sampler(9, i);
    std::vector<glm::dvec3> normals;
    LightBounds all;
    const glm::dvec3 center = random_direction(sampler);
    const double width = 2.0 * sampler.one();
    for (int k = 0; k < 8; ++k) {
      LightBounds one;
      one.strength = 1.0;
      one.two_sided = i % 2 == 0;
      one.axis = glm::normalize(center + width * random_direction(sampler));
      normals.push_back(one.axis);
      all = united(all, one);
    }
    for (const glm::dvec3& normal : normals) {
      const double cosine = glm::dot(normal, all.axis);
      const double off = std::acos(std::clamp(all.two_sided ? std::abs(cosine) : cosine, -1.0, 1.0));
      EXPECT_LE(off, all.spread_radians + 1e-7);
    }
  }
}

}  // namespace
}  // namespace hpr
