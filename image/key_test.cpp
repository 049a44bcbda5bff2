#include "image/key.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace hpr {
namespace {

using Limits = std::numeric_limits<float>;

TEST(Key, GivesBackItsDepthAndSurface) {
  for (const float depth : {0.0F, Limits::denorm_min(), Limits::min(), 0.1F, 0.5F, 1.0F}) {
    for (const std::uint32_t surface : {0U, 1U, 123456789U, 0xFFFFFFFEU}) {
      const Key key = make_key(depth, surface);
      EXPECT_EQ(std::bit_cast<std::uint32_t>(key_depth(key)), std::bit_cast<std::uint32_t>(depth));
      EXPECT_EQ(key_surface(key), surface);
    }
  }
  const Key key = make_color_key(0.25F, 0xA1B2C3D4U);
  EXPECT_EQ(key_depth(key), 0.25F);
  EXPECT_EQ(key_rgba(key), 0xA1B2C3D4U);
}

TEST(Key, IsTheDepthBitsAboveTheComplementOfTheSurface) {
  EXPECT_EQ(make_key(1.0F, 0), 0x3F800000FFFFFFFFU);
  EXPECT_EQ(make_key(0.5F, 5), 0x3F000000FFFFFFFAU);
  EXPECT_EQ(make_color_key(1.0F, 7), 0x3F80000000000007U);
}

TEST(Key, TheNearerSurfaceIsLargerWhateverItsId) {
  const std::vector<float> ascending{
      0.0F, Limits::denorm_min(), 2 * Limits::denorm_min(), Limits::min(), 1e-20F, 0.5F, std::nextafter(1.0F, 0.0F),
      1.0F};
  for (std::size_t i = 1; i < ascending.size(); ++i) {
    EXPECT_GT(make_key(ascending[i], 0xFFFFFFFEU), make_key(ascending[i - 1], 0)) << ascending[i];
  }
}

TEST(Key, TheLowerSurfaceWinsATie) {
  for (const float depth : {0.0F, Limits::denorm_min(), 0.7F}) {
    EXPECT_GT(make_key(depth, 0), make_key(depth, 1));
    EXPECT_GT(make_key(depth, 0xFFFFFFFDU), make_key(depth, 0xFFFFFFFEU));
    EXPECT_EQ(std::max(make_key(depth, 9), make_key(depth, 4)), make_key(depth, 4));
  }
}

TEST(Key, AnySurfaceIsMoreThanNothing) {
  EXPECT_GT(make_key(0.0F, 0xFFFFFFFEU), kNoKey);
}

}  // namespace
}  // namespace hpr
