#include "scene/studio.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

namespace hpr {
namespace {

glm::dvec3 direction_of(const Size& size, int x, int y) {
  const double polar = std::numbers::pi * (y + 0.5) / size.height;
  const double azimuth = 2.0 * std::numbers::pi * (x + 0.5) / size.width;
  // The first column lies along +z, as the central one along -z.
  return {-std::sin(polar) * std::sin(azimuth), std::cos(polar), std::sin(polar) * std::cos(azimuth)};
}

/// The radiance of a white matte surface of that normal.
double white_facing(const Environment& environment, const glm::dvec3& normal) {
  const Size size = environment.image.size();
  double sum = 0.0;
  for (int y = 0; y < size.height; ++y) {
    const double row = 2.0 * std::numbers::pi / size.width * (std::numbers::pi / size.height) *
                       std::sin(std::numbers::pi * (y + 0.5) / size.height);
    for (int x = 0; x < size.width; ++x) {
      const double cosine = std::max(glm::dot(normal, direction_of(size, x, y)), 0.0);
      sum += row * cosine * static_cast<double>(environment.image.at(x, y).g);
    }
  }
  return sum / std::numbers::pi;
}

TEST(Studio, LightsWhiteAsDocumentedAndLeavesNoSideDark) {
  const Environment studio = make_studio();
  EXPECT_NEAR(white_facing(studio, {0.0, 1.0, 0.0}), 1.0, 0.05);
  EXPECT_NEAR(white_facing(studio, {0.0, 0.0, 1.0}), 0.65, 0.05);
  for (const glm::dvec3& normal :
       {glm::dvec3(1, 0, 0), glm::dvec3(-1, 0, 0), glm::dvec3(0, 0, -1), glm::dvec3(0, -1, 0)}) {
    EXPECT_GT(white_facing(studio, normal), 0.2);
    EXPECT_LT(white_facing(studio, normal), 1.0);
  }
}

TEST(Studio, IsGreyAndCalmAtTheHorizon) {
  const Environment studio = make_studio();
  const Size size = studio.image.size();
  for (const Rgb& color : studio.image.pixels()) EXPECT_TRUE(color.r == color.g && color.g == color.b);
  for (int x = 0; x < size.width; ++x) {
    EXPECT_NEAR(studio.image.at(x, size.height / 2).g, 0.35, 0.01);
    EXPECT_NEAR(studio.image.at(x, 0).g, 1.0, 0.01);
    EXPECT_NEAR(studio.image.at(x, size.height - 1).g, 0.2, 0.01);
  }
}

}  // namespace
}  // namespace hpr
