#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <random>
#include <vector>

#include "rt/trace/ray_scene.h"

/// Rays that tests ask two ray scenes for.
namespace hpr::test {

/// From places and in directions of all kinds, along an axis too; some short, a few invalid.
inline RayBatch random_rays(int count, unsigned int seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> coordinate(-2.0, 2.0);
  std::normal_distribution<double> normal;
  RayBatch rays;
  for (int i = 0; i < count; ++i) {
    const glm::dvec3 origin(coordinate(random), coordinate(random), coordinate(random));
    glm::dvec3 direction = glm::normalize(glm::dvec3(normal(random), normal(random), normal(random)));
    if (i % 7 == 0) direction = {0.0, i % 2 == 0 ? 1.0 : -1.0, 0.0};
    if (i % 50 == 49) direction = glm::dvec3(std::nan(""));
    rays.push(origin, direction, i % 3 == 0 ? 0.7 : std::numeric_limits<double>::infinity());
  }
  return rays;
}

/// Expects that rays meet in `scene` what they meet in `whole`: first, at all, and behind what they have passed twice.
/// Returns what they met last.
inline std::vector<std::uint32_t> expect_same_hits(const RayScene& scene, const RayScene& whole, const RayBatch& rays) {
  const std::size_t count = rays.size();
  std::vector<std::uint32_t> expected(count);
  std::vector<std::uint32_t> met(count);
  EXPECT_EQ(scene.closest(rays, met), whole.closest(rays, expected));
  EXPECT_EQ(met, expected);
  std::vector<std::uint8_t> blocks(count);
  std::vector<std::uint8_t> blocked(count);
  EXPECT_EQ(scene.occluded(rays, blocked), whole.occluded(rays, blocks));
  EXPECT_EQ(blocked, blocks);
  std::vector<Passed> before(count);
  std::vector<Passed> passed(count);
  for (int step = 0; step < 3; ++step) {
    (void)whole.closest(rays, before, expected);
    (void)scene.closest(rays, passed, met);
    EXPECT_EQ(met, expected) << "behind " << step;
    for (std::size_t i = 0; i < count; ++i) {
      if (met[i] == kNoSurface) before[i] = passed[i] = {};  // from the start again
    }
  }
  return met;
}

}  // namespace hpr::test
