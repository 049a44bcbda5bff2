#include "walls/displays/pipe_stream.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <string_view>

namespace hpr {
namespace {

/// The bytes a picture of one colour has as Y, Cb, Cr.
std::array<int, 3> encoded(Rgba8 color) {
  std::vector<std::byte> bytes;
  append_y4m_frame(Image<Rgba8>({1, 1}, color), bytes);
  EXPECT_EQ(bytes.size(), 9U);
  return {std::to_integer<int>(bytes.at(6)), std::to_integer<int>(bytes.at(7)), std::to_integer<int>(bytes.at(8))};
}

TEST(Y4m, TheHeaderSaysSizeRateAndThatValuesAreLimited) {
  EXPECT_EQ(y4m_header({640, 360}, 25), "YUV4MPEG2 W640 H360 F25:1 Ip A1:1 C444 XCOLORRANGE=LIMITED\n");
}

TEST(Y4m, KnownColorsHaveTheirValues) {
  using Values = std::array<int, 3>;
  EXPECT_EQ(encoded({0, 0, 0, 255}), (Values{16, 128, 128}));
  EXPECT_EQ(encoded({255, 255, 255, 255}), (Values{235, 128, 128}));
  EXPECT_EQ(encoded({255, 0, 0, 255}), (Values{63, 102, 240}));
  EXPECT_EQ(encoded({0, 255, 0, 255}), (Values{173, 42, 26}));
  EXPECT_EQ(encoded({0, 0, 255, 255}), (Values{32, 240, 118}));
}

TEST(Y4m, PlanesFollowEachOtherRowByRow) {
  Image<Rgba8> image({2, 2}, {0, 0, 0, 255});
  image.at(1, 0) = {255, 255, 255, 255};
  image.at(0, 1) = {255, 0, 0, 255};
  std::vector<std::byte> bytes;
  append_y4m_frame(image, bytes);
  ASSERT_EQ(bytes.size(), 6U + 12U);
  EXPECT_EQ(std::string_view(reinterpret_cast<const char*>(bytes.data()), 6), "FRAME\n");
  const std::array<int, 12> expected{16, 235, 63, 16, 128, 128, 102, 128, 128, 128, 240, 128};
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_EQ(std::to_integer<int>(bytes[6 + i]), expected.at(i)) << i;
}

TEST(Y4m, ReadBackRedAndGreenAreOffByAtMostOneAndBlueByTwo) {
  int worst_red = 0;
  int worst_green = 0;
  int worst_blue = 0;
  for (int r = 0; r < 256; r += 5) {
    for (int g = 0; g < 256; g += 3) {
      for (int b = 0; b < 256; b += 5) {
        const Rgba8 color{static_cast<std::uint8_t>(r), static_cast<std::uint8_t>(g), static_cast<std::uint8_t>(b),
                          255};
        const auto [y, cb, cr] = encoded(color);
        const double luma = (y - 16) / 219.0;
        const double red = luma + 1.5748 * (cr - 128) / 224.0;
        const double blue = luma + 1.8556 * (cb - 128) / 224.0;
        const double green = (luma - 0.2126 * red - 0.0722 * blue) / 0.7152;
        worst_red = std::max(worst_red, std::abs(static_cast<int>(std::lround(255.0 * red)) - r));
        worst_green = std::max(worst_green, std::abs(static_cast<int>(std::lround(255.0 * green)) - g));
        worst_blue = std::max(worst_blue, std::abs(static_cast<int>(std::lround(255.0 * blue)) - b));
      }
    }
  }
  EXPECT_LE(worst_red, 1);
  EXPECT_LE(worst_green, 1);
  EXPECT_LE(worst_blue, 2);
}

}  // namespace
}  // namespace hpr
