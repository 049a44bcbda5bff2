#include "walls/drawing/pattern.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "walls/config/wall_file.h"

namespace hpr {
namespace {

std::uint64_t read(const Image<Rgba8>& image) {
  std::uint64_t frame = 0;
  for (int bit = 0; bit < kFrameCounterBits; ++bit) {
    const Rect bar = frame_counter_bar(image.size(), bit);
    const Rgba8 color = image.at((bar.x0 + bar.x1) / 2, (bar.y0 + bar.y1) / 2);
    EXPECT_TRUE(color.r == 0 || color.r == 255);
    frame |= static_cast<std::uint64_t>(color.r == 255 ? 1 : 0) << static_cast<unsigned>(bit);
  }
  return frame;
}

TEST(FrameCounter, CountsInBarsThatCanBeReadBack) {
  Image<Rgba8> image = wall_pattern(load_wall("1x1@640x360"), 0);
  for (const std::uint64_t frame : {0U, 1U, 2U, 41U, 65535U, 65536U, 70000U}) {
    draw_frame_counter(image, frame);
    EXPECT_EQ(read(image), frame % 65536) << frame;
  }
}

TEST(FrameCounter, TheHighestBitIsAtTheLeft) {
  for (int bit = 1; bit < kFrameCounterBits; ++bit) {
    EXPECT_LE(frame_counter_bar({640, 360}, bit).x1, frame_counter_bar({640, 360}, bit - 1).x0);
  }
}

TEST(FrameCounter, LeavesNothingOfTheFrameBefore) {
  Image<Rgba8> counted = wall_pattern(load_wall("1x1@320x200"), 0);
  Image<Rgba8> fresh = counted;
  draw_frame_counter(counted, 65535);
  draw_frame_counter(counted, 7);
  draw_frame_counter(fresh, 7);
  EXPECT_TRUE(std::ranges::equal(counted.pixels(), fresh.pixels()));
}

TEST(FrameCounter, PatternsTooSmallForItStayAsTheyAre) {
  for (const Size size : {Size{1, 1}, Size{16, 16}, Size{2000, 3}, Size{3, 2000}}) {
    Image<Rgba8> image(size);
    const Image<Rgba8> before = image;
    draw_frame_counter(image, 65535);
    EXPECT_TRUE(std::ranges::equal(image.pixels(), before.pixels())) << size.width << " x " << size.height;
  }
}

}  // namespace
}  // namespace hpr
