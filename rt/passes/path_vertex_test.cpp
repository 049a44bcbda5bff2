#include "rt/passes/path_vertex.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace hpr {
namespace {

/// `count` pixels of `each` points.
std::vector<PathVertex> points_of_pixels(std::size_t count, std::size_t each) {
  std::vector<PathVertex> points(count * each, PathVertex(SurfacePoint{}));
  for (std::size_t i = 0; i < points.size(); ++i) points[i].pixel = static_cast<std::uint32_t>(i / each);
  return points;
}

TEST(PathVertex, WavefrontsFromTheLastOneOnAreOfWholePixels) {
  for (const std::size_t each : {1U, 3U, 7U, 511U, 512U}) {
    std::vector<PathVertex> points = points_of_pixels(600 / each + 2, each);
    std::uint32_t end = points.back().pixel + 1;  // of the pixels that are left
    for (std::span<PathVertex> left = points; !left.empty();) {
      const std::span<PathVertex> wave = last_wavefront(left);
      ASSERT_FALSE(wave.empty());
      EXPECT_LE(wave.size(), kWavefrontVertices);
      EXPECT_EQ(wave.data() + wave.size(), left.data() + left.size());
      EXPECT_EQ(wave.size() % each, 0U) << each;
      EXPECT_EQ(wave.back().pixel + 1, end);
      end = wave.front().pixel;
      left = left.first(left.size() - wave.size());
    }
    EXPECT_EQ(end, 0U);
  }
}

TEST(PathVertex, APixelOfMorePointsThanAWavefrontStaysWhole) {
  std::vector<PathVertex> points = points_of_pixels(2, kWavefrontVertices + 1);
  const std::span<PathVertex> wave = last_wavefront(points);
  EXPECT_EQ(wave.data() + wave.size(), points.data() + points.size());
  EXPECT_EQ(wave.size() % (kWavefrontVertices + 1), 0U);
}

}  // namespace
}  // namespace hpr
