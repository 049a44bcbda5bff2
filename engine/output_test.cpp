#include "engine/output.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {
namespace {

View screen(Size size) {
  Camera camera;
  camera.lens = PerspectiveLens{.vertical_fov_radians = 1.0, .near_distance = 0.1};
  return make_view(camera, size, {});
}

TEST(AtResolution, KeepsTheFrustumAndRoundsThePixels) {
  const std::vector<View> screens{screen({1280, 720}), screen({171, 105}), screen({1, 3})};
  const std::vector<View> made = at_resolution(screens, 0.5);
  EXPECT_EQ(made[0].screen, (Size{640, 360}));
  EXPECT_EQ(made[1].screen, (Size{86, 53}));  // 85.5 and 52.5 are rounded up
  EXPECT_EQ(made[2].screen, (Size{1, 2}));
  for (std::size_t i = 0; i < made.size(); ++i) {
    EXPECT_EQ(made[i].size(), made[i].screen);
    EXPECT_EQ(made[i].left, screens[i].left);
    EXPECT_EQ(made[i].top, screens[i].top);
    const Ray corner = view_ray(screens[i], screens[i].screen.width, screens[i].screen.height);
    const Ray same = view_ray(made[i], made[i].screen.width, made[i].screen.height);
    EXPECT_EQ(corner.direction, same.direction);
  }
}

TEST(AtResolution, LeavesAPixelAtLeast) {
  EXPECT_EQ(at_resolution(std::vector{screen({4, 1})}, 0.1).front().screen, (Size{1, 1}));
}

TEST(AtResolution, MakesAScreenOfSeveralBlocksOfFewer) {
  const std::vector<View> wide{screen({40000, 10})};
  EXPECT_EQ(split_into_blocks(wide.front(), kRasterLimit).size(), 3U);
  const std::vector<View> blocks = split_into_blocks(at_resolution(wide, 0.5).front(), kRasterLimit);
  ASSERT_EQ(blocks.size(), 2U);
  EXPECT_EQ(blocks[1].block, (Rect{kRasterLimit, 0, 20000, 5}));
}

/// Blocks of one screen together have all of its pixels, and each those that enlarging reads.
TEST(AtResolution, BlocksHaveWhatEnlargingReads) {
  for (const double scale : {0.1, 0.37, 0.5, 0.7, 0.99}) {
    View left = screen({171, 105});
    View right = left;
    left.block = {0, 0, 64, 105};
    right.block = {64, 0, 171, 105};
    const Blocks blocks = cut_blocks(std::vector{left, right}, scale);
    const Rect& first = blocks.made[0].pixels;
    const Rect& second = blocks.made[1].pixels;
    EXPECT_EQ(blocks.made[0].whole, at_resolution(std::vector{screen({171, 105})}, scale).front().screen);
    EXPECT_EQ(first.x0, 0);
    EXPECT_EQ(second.x1, blocks.made[1].whole.width);
    EXPECT_EQ(first.x1, second.x0 + 2) << scale;
    EXPECT_EQ(first.height(), blocks.made[0].whole.height);
    for (std::size_t i = 0; i < 2; ++i) {
      const Rect& pixels = blocks.made[i].pixels;
      const Image<Rgb> made({pixels.width(), pixels.height()});
      EXPECT_EQ(enlarge(made, blocks.made[i], blocks.shown[i], 1).width(), i == 0 ? 64 : 107);
    }
  }
}

Image<Rgba8> with(int of_hundred, Rgba8 color) {
  Image<Rgba8> picture({10, 10}, {90, 90, 90, 255});
  std::ranges::fill(picture.pixels().first(static_cast<std::size_t>(of_hundred)), color);
  return picture;
}

TEST(Advice, IsGivenOnPicturesThatShowNextToNothing) {
  EXPECT_EQ(advice_on(with(90, {0, 0, 0, 255})), "");
  EXPECT_TRUE(advice_on(with(91, {1, 0, 1, 255})).starts_with("91 % of the picture is black: "));
  EXPECT_EQ(advice_on(with(100, {2, 0, 0, 255})), "");
  EXPECT_EQ(advice_on(with(90, {255, 255, 255, 255})), "");
  EXPECT_TRUE(advice_on(with(95, {255, 10, 0, 255})).starts_with("95 % of the picture is clipped: "));
  EXPECT_EQ(advice_on(with(95, {0, 0, 0, 0})), "") << "nothing is there";
  EXPECT_TRUE(advice_on(with(100, {0, 0, 0, 0})).starts_with("100 % of the picture is black: "));
}

}  // namespace
}  // namespace hpr
