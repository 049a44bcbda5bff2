#include "engine/wall/wall_status.h"

#include <gtest/gtest.h>

namespace hpr {
namespace {

FrameRecord frame_of(std::size_t screens) {
  FrameRecord frame;
  for (std::size_t i = 0; i < screens; ++i) frame.screens.push_back({"s" + std::to_string(i), {1, 1}, 0});
  return frame;
}

TEST(WallStatus, TellsMedianAndLeastFramesPerSecond) {
  const std::vector<double> ms{20.0, 100.0, 25.0, 10.0, 20.0};
  EXPECT_EQ(describe_status(ms, frame_of(1), {}), "50.0 fps (min 10.0)");
  EXPECT_EQ(describe_status(std::span(ms).first(1), frame_of(1), {}), "50.0 fps");
}

TEST(WallStatus, NamesTheSlowestRankItsHostAndItsPass) {
  FrameRecord frame = frame_of(1);
  frame.slowest = SlowestRecord{3, "wall05", 30.0, "shadow", 21.04};
  EXPECT_EQ(describe_status(std::vector{40.0}, frame, {}), "25.0 fps, slowest rank 3 on wall05: shadow 21.0 ms");
}

TEST(WallStatus, NamesScreensThatAreStaleOrLost) {
  using enum ScreenState;
  EXPECT_EQ(describe_status(std::vector{40.0}, frame_of(3), std::vector{Fresh, Fresh, Fresh}), "25.0 fps");
  EXPECT_EQ(describe_status(std::vector{40.0}, frame_of(3), std::vector{Lost, Fresh, Stale}),
            "25.0 fps; stale: s2; lost: s0");
  EXPECT_EQ(describe_status(std::vector{40.0}, frame_of(6), std::vector(6, Lost)),
            "25.0 fps; lost: s0, s1, s2, s3 and 2 more");
}

}  // namespace
}  // namespace hpr
