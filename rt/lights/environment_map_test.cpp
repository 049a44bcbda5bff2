#include "rt/lights/environment_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <numbers>
#include <utility>
#include <vector>

#include "rt/sampling/sampler.h"
#include "rt/sampling/sampling.h"
#include "scene/studio.h"

namespace hpr {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr std::uint32_t kSamples = 16384;
const glm::dvec3 kAllSides(0.0);

Environment patterned() {
  Environment environment{Image<Rgb>({7, 5})};
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 7; ++x) {
      environment.image.at(x, y) = {static_cast<float>((x * 5 + y * 3) % 7), static_cast<float>(x % 3), 0.0F};
    }
  }
  environment.rotation_radians = 0.7;
  environment.scale = 2.0;
  return environment;
}

Environment sun(int width, int height, int x, int y) {
  Environment environment{Image<Rgb>({width, height})};
  environment.image.at(x, y) = {5.0F, 5.0F, 5.0F};
  return environment;
}

/// The mean of `value` over all directions, by a grid.
template <typename Value>
double over_the_sphere(const Value& value, int rows = 1000) {
  double sum = 0.0;
  for (int i = 0; i < rows; ++i) {
    const double y = 1.0 - 2.0 * (i + 0.5) / rows;
    for (int j = 0; j < 2 * rows; ++j) {
      const double angle = kPi * (j + 0.5) / rows;
      const double across = std::sqrt(1.0 - y * y);
      sum += value(glm::dvec3(across * std::cos(angle), y, across * std::sin(angle)));
    }
  }
  return sum / (2.0 * rows * rows);
}

TEST(EnvironmentMap, TheDensityIntegratesToOne) {
  for (const Environment& environment : {patterned(), sun(16, 8, 3, 0), sun(9, 4, 8, 3), sun(1, 1, 0, 0)}) {
    const EnvironmentMap map(environment);
    EXPECT_NEAR(4.0 * kPi * over_the_sphere([&](const glm::dvec3& w) { return map.evaluate(w, kAllSides).pdf; }), 1.0,
                3e-3);
  }
}

TEST(EnvironmentMap, AConstantOneIsSampledAsIfItWereOnePixel) {
  for (const Size size : {Size{1, 1}, Size{1, 3}, Size{8, 4}}) {
    const Environment environment{Image<Rgb>(size, {2, 2, 2})};
    const EnvironmentMap map(environment);
    EXPECT_NEAR(map.mean().g, 2.0, 1e-14);
    double irradiance = 0.0;
    for (std::uint32_t i = 0; i < kSamples; ++i) {
      const glm::dvec3 w = map.sample(kAllSides, 0.0, Sampler(1, i).two()).value();
      const EnvironmentMap::DirectionalRadiance seen = map.evaluate(w, kAllSides);
      ASSERT_NEAR(seen.pdf * 4.0 * kPi, 1.0, 1e-12);
      ASSERT_NEAR(seen.radiance.r, 2.0, 1e-14);
      irradiance += seen.radiance.r / seen.pdf * std::max(0.0, w.y) / kSamples;
    }
    EXPECT_NEAR(irradiance / (2.0 * kPi), 1.0, 1e-3);
  }
}

TEST(EnvironmentMap, SamplesFallWhereTheDensitySays) {
  const Environment environment = patterned();
  const EnvironmentMap map(environment);
  constexpr int kBins = 10;
  const auto bin = [&](const glm::dvec3& w) {
    const auto row = std::min(static_cast<int>((1.0 - w.y) * 0.5 * kBins), kBins - 1);
    const auto column = std::min(static_cast<int>((std::atan2(w.x, w.z) / (2.0 * kPi) + 0.5) * kBins), kBins - 1);
    return static_cast<std::size_t>(row * kBins + column);
  };
  std::vector<double> expected(std::size_t{kBins} * kBins, 0.0);
  (void)over_the_sphere([&](const glm::dvec3& w) {
    expected[bin(w)] += map.evaluate(w, kAllSides).pdf * 4.0 * kPi / 2e6 * kSamples;
    return 0.0;
  });
  std::vector<double> found(expected.size(), 0.0);
  for (std::uint32_t i = 0; i < kSamples; ++i)
    found[bin(map.sample(kAllSides, 0.0, Sampler(2, i).two()).value())] += 1.0;
  double chi_square = 0.0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    chi_square += (found[i] - expected[i]) * (found[i] - expected[i]) / std::max(expected[i], 1.0);
  }
  EXPECT_LT(chi_square, 99.0 + 5.0 * std::sqrt(2.0 * 99.0));
}

/// Normals of unit length, those among them where tables of normals meet.
std::vector<glm::dvec3> some_normals() {
  std::vector<glm::dvec3> normals{{0, 1, 0}, {0, -1, 0}, {1, 0, 0}, glm::normalize(glm::dvec3(1, 1, 1))};
  for (std::uint32_t i = 0; i < 4; ++i) normals.push_back(warp::on_sphere(Sampler(9, i).two()));
  return normals;
}

TEST(EnvironmentMap, TheDensityOfEachNormalIntegratesToOne) {
  for (const Environment& environment : {patterned(), make_studio()}) {
    const EnvironmentMap map(environment);
    for (const glm::dvec3& normal : some_normals()) {
      EXPECT_NEAR(4.0 * kPi * over_the_sphere([&](const glm::dvec3& w) { return map.evaluate(w, normal).pdf; }, 300),
                  1.0, 1e-2);
    }
  }
}

/// Light at the horizon and on the edges of cells is neither left out nor so rarely found that it comes as a firefly.
TEST(EnvironmentMap, AllThatANormalSeesHasADensity) {
  for (const Environment& environment : {patterned(), sun(64, 32, 40, 16), sun(5, 3, 2, 1), make_studio()}) {
    const EnvironmentMap map(environment);
    double worst = 0.0;
    for (std::uint32_t i = 0; i < kSamples; ++i) {
      Sampler sampler(11, i);
      const glm::dvec3 normal = warp::on_sphere(sampler.two());
      const glm::dvec3 w =
          i % 2 == 0 ? map.sample(kAllSides, 0.0, sampler.two()).value() : warp::on_sphere(sampler.two());
      const EnvironmentMap::DirectionalRadiance seen = map.evaluate(w, normal);
      if (glm::dot(normal, w) > 0.0 && seen.radiance.r > 0.0) {
        ASSERT_GT(seen.pdf, 0.0) << i;
        const double value =
            (seen.radiance.r + seen.radiance.g + seen.radiance.b) / 3.0 * glm::dot(normal, w) / seen.pdf;
        worst = std::max(worst, value / map.irradiance(normal));
      }
    }
    EXPECT_LT(worst, 20.0);
  }
}

/// A matte surface's light from single samples: the mean is right, and they hardly deviate.
TEST(EnvironmentMap, SamplesSuitTheSurface) {
  const std::vector<std::pair<Environment, double>> environments{{make_studio(), 0.45}, {patterned(), 0.5}};
  for (const auto& [environment, spread] : environments) {
    const EnvironmentMap map(environment);
    for (const glm::dvec3& normal : some_normals()) {
      double sum = 0.0;
      double squares = 0.0;
      for (std::uint32_t i = 0; i < kSamples; ++i) {
        Sampler sampler(5, i);
        const double choice = sampler.one();
        const auto w = map.sample(normal, choice, sampler.two());
        ASSERT_TRUE(w);
        const EnvironmentMap::DirectionalRadiance seen = map.evaluate(*w, normal);
        const double value = seen.pdf > 0.0 ? seen.radiance.r * std::max(0.0, glm::dot(normal, *w)) / seen.pdf : 0.0;
        sum += value / kSamples;
        squares += value * value / kSamples;
      }
      const double exact =
          4.0 * kPi *
          over_the_sphere([&](const glm::dvec3& w) { return map.radiance(w).r * std::max(0.0, glm::dot(normal, w)); },
                          300);
      EXPECT_NEAR(sum / exact, 1.0, 0.01);
      EXPECT_LT(std::sqrt(squares - sum * sum), spread * exact);
    }
  }
}

TEST(EnvironmentMap, ASideWithoutLightHasNoSample) {
  const Environment above = sun(64, 32, 40, 2);
  const EnvironmentMap map(above);
  EXPECT_FALSE(map.sample({0, -1, 0}, 0.999, {0.5, 0.5}));
  EXPECT_TRUE(map.sample({0, 1, 0}, 0.999, {0.5, 0.5}));
}

TEST(EnvironmentMap, ASunOfOnePixelIsFoundByEverySample) {
  const Environment environment = sun(256, 128, 200, 40);
  const EnvironmentMap map(environment);
  const auto seen_at = [&](const glm::dvec3& w) { return map.evaluate(w, kAllSides).radiance.r; };
  double sum = 0.0;
  double squares = 0.0;
  for (std::uint32_t i = 0; i < 256; ++i) {
    const glm::dvec3 w = map.sample(kAllSides, 0.0, Sampler(3, i).two()).value();
    const EnvironmentMap::DirectionalRadiance seen = map.evaluate(w, kAllSides);
    ASSERT_GT(seen.pdf, 0.0);
    const double value = seen.radiance.r / seen.pdf;
    sum += value / 256;
    squares += value * value / 256;
  }
  const double exact = 4.0 * kPi * over_the_sphere(seen_at);
  EXPECT_NEAR(sum / exact, 1.0, 0.1);
  EXPECT_LT(std::sqrt(squares - sum * sum), 1.5 * exact)
      << "uniform directions would deviate by a hundred times as much";
  EXPECT_NEAR(map.mean().r * 4.0 * kPi / exact, 1.0, 0.01);
}

TEST(EnvironmentMap, LiesAsItsDescriptionSays) {
  // The middle lies along -z, right of it is +x, up is +y.
  const Environment ahead = sun(33, 17, 16, 8);
  EXPECT_NEAR(EnvironmentMap(ahead).radiance({0, 0, -1}).r, 5.0, 1e-12);
  EXPECT_NEAR(EnvironmentMap(ahead).radiance({0, 0, 1}).r, 0.0, 1e-12);
  const Environment right = sun(32, 17, 23, 8);
  EXPECT_GT(EnvironmentMap(right).radiance({1, 0, 0}).r, 2.0);
  EXPECT_EQ(EnvironmentMap(right).radiance({-1, 0, 0}).r, 0.0);
  const Environment above = sun(1, 5, 0, 0);
  EXPECT_NEAR(EnvironmentMap(above).radiance({0, 1, 0}).r, 5.0, 1e-12);
  Environment turned = sun(33, 17, 16, 8);
  turned.rotation_radians = 0.5 * kPi;  // from -z a quarter counterclockwise, seen from above: -x
  EXPECT_NEAR(EnvironmentMap(turned).radiance({-1, 0, 0}).r, 5.0, 1e-12);
  EXPECT_LT(glm::distance(EnvironmentMap(turned).sample(kAllSides, 0.0, {0.5, 0.5}).value(), {-1, 0, 0}), 0.1);
}

TEST(EnvironmentMap, ABlackOneOrOddDirectionsGiveNoNan) {
  const Environment black{Image<Rgb>({4, 2})};
  EXPECT_EQ(EnvironmentMap(black).evaluate({0, 1, 0}, kAllSides).pdf, 0.0);
  const Environment environment = patterned();
  const EnvironmentMap map(environment);
  for (const glm::dvec3 w : {glm::dvec3(0, 1, 0), glm::dvec3(0, -1, 0), glm::dvec3(0, 1.0000001, 0),
                             glm::dvec3(-0.0, 0, 1), glm::dvec3(0.0, 0, 1)}) {
    EXPECT_TRUE(std::isfinite(map.evaluate(w, kAllSides).pdf) && std::isfinite(map.evaluate(w, kAllSides).radiance.r));
  }
  for (const glm::dvec2 u : {glm::dvec2(0.0), glm::dvec2(1.0 - 1e-16)}) {
    EXPECT_NEAR(glm::length(map.sample(kAllSides, 0.0, u).value()), 1.0, 1e-12);
  }
}

}  // namespace
}  // namespace hpr
