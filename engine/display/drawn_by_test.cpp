#include "engine/display/drawn_by.h"

#include <gtest/gtest.h>

#include <array>

namespace hpr {
namespace {

// Ranks 0 and 1 share the objects on the left tile, rank 2 draws all of them on the right one.
TEST(DrawnBy, ASurfaceIsDrawnByTheRankOfTheTilesGroupThatHasIt) {
  const FrameLayout layout({Size{128, 64}});
  const std::vector<Assignment> assignments{
      {.group = {0, 1}, .objects = {{0, 4}, {10, 12}}, .area = {{0, {0, 0, 64, 64}}}},
      {.group = {0, 1}, .objects = {{4, 10}}, .area = {{0, {0, 0, 64, 64}}}},
      {.group = {2}, .objects = {{0, 12}}, .area = {{0, {64, 0, 128, 64}}}},
  };
  const DrawnBy drawn_by(assignments, layout);
  constexpr std::array<int, 12> kLeft{0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 0, 0};
  for (std::uint32_t surface = 0; surface < kLeft.size(); ++surface) {
    EXPECT_EQ(drawn_by.rank_of(0, surface), kLeft.at(surface)) << surface;
    EXPECT_EQ(drawn_by.rank_of(1, surface), 2) << surface;
  }
}

}  // namespace
}  // namespace hpr
