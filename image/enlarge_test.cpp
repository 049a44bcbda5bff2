#include "image/enlarge.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace hpr {
namespace {

/// Red tells the column, green the row, blue is even.
Image<Rgb> slope(Size size) {
  Image<Rgb> image(size);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      image.at(x, y) = {(static_cast<float>(x) + 0.5F) / static_cast<float>(size.width),
                        (static_cast<float>(y) + 0.5F) / static_cast<float>(size.height), 0.3F};
    }
  }
  return image;
}

TEST(Enlarge, OfTheSameSizeIsTheSame) {
  for (const Size size : {Size{1, 1}, Size{7, 5}, Size{64, 33}}) {
    const Image<Rgb> image = slope(size);
    EXPECT_EQ(enlarge(image, size, 1), image);
  }
}

TEST(Enlarge, KeepsAnEvenPicture) {
  const Rgb color{0.1F, 1e-30F, 3e30F};
  const Image<Rgb> even({3, 5}, color);
  const Image<Rgb> large = enlarge(even, {31, 40}, 2);
  EXPECT_TRUE(std::ranges::all_of(large.pixels(), [&](const Rgb& each) { return each == color; }));
}

TEST(Enlarge, PutsASlopeWhereItWas) {
  // Pixel centres keep their places on the screen: off by half a pixel, the picture would shift as it is made smaller.
  for (const Size from : {Size{10, 6}, Size{7, 9}}) {
    const Size to{33, 25};
    const Image<Rgb> large = enlarge(slope(from), to, 2);
    for (int y = 0; y < to.height; ++y) {
      for (int x = 0; x < to.width; ++x) {
        const double column = (x + 0.5) / to.width;
        const double row = (y + 0.5) / to.height;
        const double half_column = 0.5 / from.width;  // nothing is known beyond the outermost centres
        const double half_row = 0.5 / from.height;
        ASSERT_NEAR(large.at(x, y).r, std::clamp(column, half_column, 1.0 - half_column), 1e-6) << x << ' ' << y;
        ASSERT_NEAR(large.at(x, y).g, std::clamp(row, half_row, 1.0 - half_row), 1e-6) << x << ' ' << y;
        ASSERT_EQ(large.at(x, y).b, 0.3F);
      }
    }
  }
}

TEST(Enlarge, MixesInLinearLight) {
  Image<Rgb> image({2, 1});
  image.at(1, 0) = {8.0F, 4.0F, 0.0F};
  const Image<Rgb> large = enlarge(image, {4, 1}, 1);
  EXPECT_EQ(large.at(0, 0), Rgb{});
  EXPECT_EQ(large.at(1, 0), (Rgb{2.0F, 1.0F, 0.0F}));
  EXPECT_EQ(large.at(2, 0), (Rgb{6.0F, 3.0F, 0.0F}));
  EXPECT_EQ(large.at(3, 0), (Rgb{8.0F, 4.0F, 0.0F}));
}

TEST(Enlarge, HasTheSameBitsForAnyNumberOfThreads) {
  Image<Rgb> image({37, 23});
  for (std::size_t i = 0; i < image.pixels().size(); ++i) {
    const auto value = static_cast<float>(std::sin(static_cast<double>(i) * 12.9898) * 43758.5453);
    image.pixels()[i] = {value, -value, value * value};
  }
  const Image<Rgb> alone = enlarge(image, {111, 70}, 1);
  for (const int threads : {2, 5}) EXPECT_EQ(enlarge(image, {111, 70}, threads), alone);
}

TEST(Enlarge, ADotGrowsFromOnePixel) {
  const Image<Rgb> large = enlarge(Image<Rgb>({1, 1}, {1.0F, 2.0F, 3.0F}), {50, 3}, 1);
  EXPECT_TRUE(std::ranges::all_of(large.pixels(), [](const Rgb& each) { return each == Rgb{1.0F, 2.0F, 3.0F}; }));
}

}  // namespace
}  // namespace hpr
