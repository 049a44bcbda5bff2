#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <numbers>
#include <vector>

#include "rt/lights/triangle_lights.h"
#include "rt/sampling/sampler.h"

namespace hpr {
namespace {

constexpr double kPi = std::numbers::pi;

struct Triangle {
  glm::dvec3 v0{0.0};
  glm::dvec3 e1{0.0};
  glm::dvec3 e2{0.0};
};

SphericalTriangle seen_from(const glm::dvec3& position, const Triangle& triangle) {
  return {position, triangle.v0, triangle.e1, triangle.e2};
}

/// Lambert's formula: the irradiance from a triangle of radiance 1 wholly above the plane of `normal`.
double irradiance(const glm::dvec3& position, const glm::dvec3& normal, const Triangle& triangle) {
  const std::vector<glm::dvec3> corners{triangle.v0, triangle.v0 + triangle.e1, triangle.v0 + triangle.e2};
  double sum = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    const glm::dvec3 a = corners[i] - position;
    const glm::dvec3 b = corners[(i + 1) % 3] - position;
    const glm::dvec3 cross = glm::cross(a, b);
    sum += std::atan2(glm::length(cross), glm::dot(a, b)) * glm::dot(glm::normalize(cross), normal);
  }
  return std::abs(0.5 * sum);
}

TEST(SphericalTriangle, AnOctantIsAnEighthOfTheSphere) {
  const SphericalTriangle octant = seen_from({0, 0, 0}, {{1, 0, 0}, {-1, 1, 0}, {-1, 0, 1}});
  EXPECT_NEAR(octant.solid_angle(), 0.5 * kPi, 1e-15);
}

TEST(SphericalTriangle, ASmallOneKeepsItsDigits) {
  for (const double size : {1e-3, 1e-6, 1e-9, 1e-12}) {
    const SphericalTriangle small = seen_from({0, 0, 0}, {{0.3, 0.4, 2.0}, {size, 0, 0}, {0, size, 0}});
    const double distance2 = 0.09 + 0.16 + 4.0;
    const double expected = 0.5 * size * size * 2.0 / (distance2 * std::sqrt(distance2));
    EXPECT_NEAR(small.solid_angle() / expected, 1.0, 10.0 * size + 1e-12) << size;
    EXPECT_EQ(small.can_sample(), expected >= 1e-6);
  }
}

/// Samples fall into parts of a triangle as often as the parts' solid angles say.
double chi_square_deviation(const glm::dvec3& position, const Triangle& triangle, double& outside) {
  constexpr int kParts = 6;
  constexpr std::uint32_t kSamples = 36'000;
  const SphericalTriangle seen = seen_from(position, triangle);
  std::vector<double> hits(std::size_t{kParts} * kParts * 2, 0.0);
  const auto cell = [](int i, int j, bool upper) {
    return static_cast<std::size_t>((i * kParts + j) * 2 + (upper ? 1 : 0));
  };
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const glm::dvec3 w = seen.sample(Sampler(7, i).two());
    const glm::dvec3 from_v0 = position - triangle.v0;
    const glm::dvec3 p = glm::cross(w, triangle.e2);
    const double determinant = glm::dot(triangle.e1, p);
    const double u = glm::dot(from_v0, p) / determinant * kParts;
    const double v = glm::dot(w, glm::cross(from_v0, triangle.e1)) / determinant * kParts;
    outside = std::max({outside, -u, -v, u + v - kParts});
    const int a = std::clamp(static_cast<int>(u), 0, kParts - 1);
    const int b = std::clamp(static_cast<int>(v), 0, kParts - 1 - a);
    hits[cell(a, b, u - a + (v - b) > 1.0)] += 1.0;
  }
  double chi_square = 0.0;
  double cells = 0.0;
  const glm::dvec3 e1 = triangle.e1 / static_cast<double>(kParts);
  const glm::dvec3 e2 = triangle.e2 / static_cast<double>(kParts);
  for (int a = 0; a < kParts; ++a) {
    for (int b = 0; a + b < kParts; ++b) {
      for (const bool upper : {false, true}) {
        if (upper && a + b + 1 >= kParts) continue;
        const glm::dvec3 corner = triangle.v0 + (a + (upper ? 1.0 : 0.0)) * e1 + (b + (upper ? 1.0 : 0.0)) * e2;
        const double part = upper ? SphericalTriangle(position, corner, -e1, -e2).solid_angle()
                                  : SphericalTriangle(position, corner, e1, e2).solid_angle();
        const double expected = kSamples * part / seen.solid_angle();
        const double off = hits[cell(a, b, upper)] - expected;
        chi_square += off * off / expected;
        cells += 1.0;
      }
    }
  }
  return (chi_square - (cells - 1.0)) / std::sqrt(2.0 * (cells - 1.0));
}

TEST(SphericalTriangle, SamplesAreUniformOverTheSolidAngle) {
  const Triangle triangle{{-1, -0.5, 0}, {2, 0.1, 0.3}, {0.2, 1.7, -0.4}};
  for (const glm::dvec3 position : {glm::dvec3(0, 0, 1), glm::dvec3(-0.3, 0, 0.05), glm::dvec3(3, -2, 1),
                                    glm::dvec3(20, 30, 40), glm::dvec3(-300, 100, 900)}) {
    ASSERT_TRUE(seen_from(position, triangle).can_sample()) << position.z;
    double outside = 0.0;
    EXPECT_LT(chi_square_deviation(position, triangle, outside), 5.0) << position.z;
    EXPECT_LT(outside, 1e-6) << position.z;
  }
}

TEST(SphericalTriangle, TheMeanCosineGivesLambertsFormFactor) {
  const glm::dvec3 normal(0, 0, 1);
  const Triangle triangle{{-0.4, -0.5, 1.0}, {2, 0.1, 0.3}, {0.2, 1.7, -0.4}};
  for (const glm::dvec3 position : {glm::dvec3(0, 0, 0), glm::dvec3(5, 1, -0.5), glm::dvec3(0.2, 0.1, 0.8)}) {
    const SphericalTriangle seen = seen_from(position, triangle);
    double sum = 0.0;
    constexpr std::uint32_t kSamples = 16384;
    for (std::uint32_t i = 0; i < kSamples; ++i) sum += glm::dot(normal, seen.sample(Sampler(3, i).two()));
    const double expected = irradiance(position, normal, triangle);
    EXPECT_NEAR(sum / kSamples * seen.solid_angle() / expected, 1.0, 1e-3);
  }
}

TEST(SphericalTriangle, WhatCannotBeSampledSaysSoAndNothingIsNan) {
  const Triangle triangle{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  for (const glm::dvec3 position : {glm::dvec3(0, 0, 0), glm::dvec3(0.25, 0.25, 0), glm::dvec3(5, 5, 0),
                                    glm::dvec3(0.5, 0, 0), glm::dvec3(1e300, 0, 0), glm::dvec3(0.25, 0.25, 1e-300)}) {
    const SphericalTriangle seen = seen_from(position, triangle);
    EXPECT_TRUE(std::isfinite(seen.solid_angle()));
    EXPECT_FALSE(seen.can_sample()) << position.x;
  }
  for (const Triangle& flat : {Triangle{{0, 0, 1}, {1, 0, 0}, {2, 0, 0}}, Triangle{{0, 0, 1}, {0, 0, 0}, {0, 1, 0}},
                               Triangle{{1, 0, 0}, {-2, 0, 0}, {0, 1, 0}}}) {
    EXPECT_FALSE(seen_from({0, 0, 0}, flat).can_sample());
  }
  const SphericalTriangle seen = seen_from({0.2, 0.2, 1e-3}, triangle);
  ASSERT_TRUE(seen.can_sample());
  for (const glm::dvec2 u :
       {glm::dvec2(0, 0), glm::dvec2(1 - 1e-16, 0), glm::dvec2(0, 1 - 1e-16), glm::dvec2(1 - 1e-16)}) {
    EXPECT_NEAR(glm::length(seen.sample(u)), 1.0, 1e-12);
  }
}

}  // namespace
}  // namespace hpr
