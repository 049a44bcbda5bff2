#include "image/half.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace hpr {
namespace {

/// The definition, for finite halves.
double value_of(Half half) {
  const int exponent = half >> 10U & 0x1F;
  const int mantissa = half & 0x3FF;
  const double magnitude = exponent == 0 ? std::ldexp(mantissa, -24) : std::ldexp(1024 + mantissa, exponent - 25);
  return (half & 0x8000U) != 0 ? -magnitude : magnitude;
}

TEST(Half, EveryFiniteOneIsWhatTheStandardSaysAndComesBack) {
  for (std::uint32_t bits = 0; bits < 65536; ++bits) {
    const auto half = static_cast<Half>(bits);
    if ((half & 0x7C00U) == 0x7C00U) continue;
    EXPECT_EQ(static_cast<double>(from_half(half)), value_of(half)) << bits;
    EXPECT_EQ(std::signbit(from_half(half)), bits >= 0x8000U);
    EXPECT_EQ(to_half(from_half(half)), half) << bits;
  }
}

TEST(Half, BetweenEachTwoTheNearerIsTakenAndTheEvenOneInTheMiddle) {
  for (std::uint32_t bits = 0; bits < 0x7BFF; ++bits) {
    const auto low = static_cast<Half>(bits);
    const auto high = static_cast<Half>(bits + 1);
    const auto middle = static_cast<float>((value_of(low) + value_of(high)) / 2);  // exact: one bit more than a half's
    const Half even = bits % 2 == 0 ? low : high;
    EXPECT_EQ(to_half(middle), even) << bits;
    EXPECT_EQ(to_half(std::nextafter(middle, 0.0F)), low) << bits;
    EXPECT_EQ(to_half(std::nextafter(middle, 1e9F)), high) << bits;
    EXPECT_EQ(to_half(-middle), even | 0x8000U) << bits;
  }
}

TEST(Half, LightPastTheLargestStaysFinite) {
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
