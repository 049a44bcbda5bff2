#include "walls/drawing/assemble.h"

#include <gtest/gtest.h>

#include "walls/config/wall_file.h"

namespace hpr {
namespace {

/// Every pixel tells where it came from.
Image<Rgba8> marked(std::size_t screen, Size size) {
  Image<Rgba8> image(size);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      image.at(x, y) = {static_cast<std::uint8_t>(x), static_cast<std::uint8_t>(y),
                        static_cast<std::uint8_t>(screen + 1), 255};
    }
  }
  return image;
}

TEST(DrawWall, PlacesEveryPixelAndPaintsTheGaps) {
  Wall wall = load_wall("3x2@50x40");
  wall.gap_color = {1, 2, 0, 255};
  const WallPicture picture = wall_picture(wall, 1000);
  std::vector<Image<Rgba8>> screens;
  for (std::size_t i = 0; i < 6; ++i) screens.push_back(marked(i, {50, 40}));
  const Image<Rgba8> drawn = draw_wall(wall, picture, screens);
  ASSERT_EQ(drawn.size(), picture.size);
  std::size_t gaps = 0;
  for (int y = 0; y < drawn.height(); ++y) {
    for (int x = 0; x < drawn.width(); ++x) {
      const Rgba8 pixel = drawn.at(x, y);
      if (pixel.b == 0) {
        EXPECT_EQ(pixel, wall.gap_color);
        ++gaps;
        continue;
      }
      const Rect rect = picture.screens.at(pixel.b - 1U);
      ASSERT_EQ(x, rect.x0 + pixel.r);
      ASSERT_EQ(y, rect.y0 + pixel.g);
    }
  }
  EXPECT_EQ(gaps, drawn.size().area() - 6 * 50 * 40);
  EXPECT_GT(gaps, 0U);
}

TEST(DrawWall, AnEmptyPictureLeavesItsPlaceBlack) {
  const Wall wall = load_wall("2x1@8x8");
  const WallPicture picture = wall_picture(wall, 100);
  const std::vector<Image<Rgba8>> screens{Image<Rgba8>({8, 8}, {9, 9, 9, 255}), Image<Rgba8>()};
  const Image<Rgba8> drawn = draw_wall(wall, picture, screens);
  EXPECT_EQ(drawn.at(picture.screens[0].x0, 0), (Rgba8{9, 9, 9, 255}));
  EXPECT_EQ(drawn.at(picture.screens[1].x0, 0), (Rgba8{0, 0, 0, 255}));
}

TEST(Resample, AveragesLightNotLevels) {
  Image<Rgba8> checker({2, 2}, {0, 0, 0, 255});
  checker.at(0, 0) = checker.at(1, 1) = {255, 255, 255, 255};
  EXPECT_EQ(resample(checker, {1, 1}).at(0, 0), (Rgba8{188, 188, 188, 255}));
}

TEST(Resample, KeepsAConstantAtAnyRatio) {
  const Rgba8 color{17, 130, 250, 255};
  const Image<Rgba8> flat({37, 23}, color);
  for (const Size size : {Size{1, 1}, Size{36, 22}, Size{37, 23}, Size{100, 7}, Size{5, 90}}) {
    const Image<Rgba8> result = resample(flat, size);
    ASSERT_EQ(result.size(), size);
    for (const Rgba8 pixel : result.pixels()) ASSERT_EQ(pixel, color);
  }
}

TEST(Resample, WeighsColorsByTheirAlpha) {
  Image<Rgba8> image({2, 1});
  image.at(0, 0) = {200, 100, 50, 255};
  EXPECT_EQ(resample(image, {1, 1}).at(0, 0), (Rgba8{200, 100, 50, 128}));
  EXPECT_EQ(resample(Image<Rgba8>({2, 1}), {1, 1}).at(0, 0), Rgba8{});
}

TEST(OverBlack, TakesLightByAlpha) {
  Image<Rgba8> image({3, 1}, {200, 100, 50, 255});
  image.at(1, 0).a = 0;
  image.at(2, 0) = {255, 255, 255, 128};
  const Image<Rgba8> shown = over_black(image);
  EXPECT_EQ(shown.at(0, 0), image.at(0, 0));
  EXPECT_EQ(shown.at(1, 0), (Rgba8{0, 0, 0, 255}));
  EXPECT_EQ(shown.at(2, 0), (Rgba8{188, 188, 188, 255})) << "half the light";
}

TEST(TurnClockwise, MovesTheUpperLeftCornerRound) {
  const Image<Rgba8> image = marked(0, {3, 2});
  EXPECT_EQ(turn_clockwise(image, 0), image);
  EXPECT_EQ(turn_clockwise(image, 90).size(), (Size{2, 3}));
  EXPECT_EQ(turn_clockwise(image, 90).at(1, 0), image.at(0, 0));
  EXPECT_EQ(turn_clockwise(image, 180).at(2, 1), image.at(0, 0));
  EXPECT_EQ(turn_clockwise(image, 270).at(0, 2), image.at(0, 0));
  EXPECT_EQ(turn_clockwise(turn_clockwise(image, 90), 270), image);
}

}  // namespace
}  // namespace hpr
