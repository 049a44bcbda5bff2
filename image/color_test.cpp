#include "image/color.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace hpr {
namespace {

std::uint8_t level_of(float linear) {
  return to_srgb({linear, 0.0F, 0.0F}).r;
}

/// IEC 61966-2-1, level in [0, 1].
double linear_of(double level) {
  return level <= 0.04045 ? level / 12.92 : std::pow((level + 0.055) / 1.055, 2.4);
}

TEST(Color, EveryLevelSurvivesTheConversionToLinearAndBack) {
  for (int level = 0; level < 256; ++level) {
    EXPECT_EQ(level_of(srgb_to_linear(static_cast<std::uint8_t>(level))), level);
  }
}

TEST(Color, EncodesWithoutRoundingAndBack) {
  for (int level = 0; level < 256; ++level) {
    const float display = static_cast<float>(level) / 255.0F;
    EXPECT_NEAR(decode_srgb(display), linear_of(static_cast<double>(level) / 255.0), 1e-6) << level;
    EXPECT_NEAR(encode_srgb(decode_srgb(display)), display, 1e-6F) << level;
  }
  EXPECT_NEAR(encode_srgb(0.5F), 0.735357F, 1e-6F);
  EXPECT_EQ(encode_srgb(-1.0F), 0.0F);
  EXPECT_EQ(encode_srgb(7.0F), encode_srgb(1.0F));
  EXPECT_EQ(decode_srgb(-1.0F), 0.0F);
  EXPECT_EQ(decode_srgb(2.0F), 1.0F);
  EXPECT_TRUE(std::isnan(encode_srgb(std::numeric_limits<float>::quiet_NaN())));
}

TEST(Color, DecodesKnownLevels) {
  EXPECT_EQ(srgb_to_linear(0), 0.0F);
  EXPECT_EQ(srgb_to_linear(255), 1.0F);
  EXPECT_FLOAT_EQ(srgb_to_linear(10), 10.0F / 255.0F / 12.92F);  // on the straight part
  EXPECT_NEAR(srgb_to_linear(128), 0.21586F, 1e-5F);
}

TEST(Color, EncodesToTheNearestLevel) {
  for (int level = 0; level < 255; ++level) {
    const double border = linear_of((level + 0.5) / 255.0);
    auto below = static_cast<float>(border);
    while (static_cast<double>(below) >= border) below = std::nextafter(below, -1.0F);
    const float above = std::nextafter(below, 2.0F);
    EXPECT_EQ(level_of(below), level);
    EXPECT_EQ(level_of(above), level + 1);
  }
}

TEST(Color, EncodingIsMonotone) {
  int last = 0;
  for (int i = -1000; i <= 70000; ++i) {
    const int level = level_of(static_cast<float>(i) / 65536.0F);
    EXPECT_GE(level, last);
    last = level;
  }
  EXPECT_EQ(last, 255);
}

TEST(Color, ClampsAndMakesNanBlack) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  EXPECT_EQ(level_of(-1.0F), 0);
  EXPECT_EQ(level_of(-kInfinity), 0);
  EXPECT_EQ(level_of(-0.0F), 0);
  EXPECT_EQ(level_of(7.0F), 255);
  EXPECT_EQ(level_of(kInfinity), 255);
  EXPECT_EQ(level_of(std::numeric_limits<float>::quiet_NaN()), 0);
}

TEST(Color, KeepsChannelsApartAndIsOpaque) {
  EXPECT_EQ(to_srgb({0.0F, 1.0F, srgb_to_linear(77)}), (Rgba8{0, 255, 77, 255}));
}

TEST(Color, AWordHoldsRedInItsLowestByte) {
  EXPECT_EQ(to_word({1, 2, 3, 4}), 0x04030201U);
  EXPECT_EQ(from_word(0x04030201U), (Rgba8{1, 2, 3, 4}));
}

/// The definition, for finite halves.
double value_of(HalfBits half) {
  const int exponent = half >> 10U & 0x1F;
  const int mantissa = half & 0x3FF;
  const double magnitude = exponent == 0 ? std::ldexp(mantissa, -24) : std::ldexp(1024 + mantissa, exponent - 25);
  return (half & 0x8000U) != 0 ? -magnitude : magnitude;
}

TEST(Half, EveryFiniteOneIsWhatTheStandardSaysAndComesBack) {
  for (std::uint32_t bits = 0; bits < 65536; ++bits) {
    const auto half = static_cast<HalfBits>(bits);
    if ((half & 0x7C00U) == 0x7C00U) continue;
    EXPECT_EQ(static_cast<double>(from_half(half)), value_of(half)) << bits;
    EXPECT_EQ(std::signbit(from_half(half)), bits >= 0x8000U);
    EXPECT_EQ(to_half(from_half(half)), half) << bits;
  }
}

TEST(Half, BetweenEachTwoTheNearerIsChosenAndTheEvenOneAtTheMidpoint) {
  for (std::uint32_t bits = 0; bits < 0x7BFF; ++bits) {
    const auto low = static_cast<HalfBits>(bits);
    const auto high = static_cast<HalfBits>(bits + 1);
    const auto midpoint =
        static_cast<float>((value_of(low) + value_of(high)) / 2);  // exact: one bit more than a half's
    const HalfBits even = bits % 2 == 0 ? low : high;
    EXPECT_EQ(to_half(midpoint), even) << bits;
    EXPECT_EQ(to_half(std::nextafter(midpoint, 0.0F)), low) << bits;
    EXPECT_EQ(to_half(std::nextafter(midpoint, 1e9F)), high) << bits;
    EXPECT_EQ(to_half(-midpoint), even | 0x8000U) << bits;
  }
}

TEST(Half, LightPastTheMaximumStaysFinite) {
  const float infinity = std::numeric_limits<float>::infinity();
  for (const float large : {65504.0F, 65519.0F, 65520.0F, 1e9F, infinity}) {
    EXPECT_EQ(from_half(to_half(large)), 65504.0F);
    EXPECT_EQ(from_half(to_half(-large)), -65504.0F);
  }
  EXPECT_EQ(to_half(std::nanf("")), 0);
  EXPECT_EQ(to_half(std::numeric_limits<float>::denorm_min()), 0);
}

}  // namespace

}  // namespace hpr
