#include "rt/show/show.h"

#include <algorithm>
#include <cmath>

namespace hpr {

Rgb distinct_color(std::uint32_t number) {
  constexpr double kGoldenSection = 0.6180339887498949;
  constexpr std::array<double, 3> kValues{1.0, 0.8, 0.6};
  constexpr double kMinChannel = 0.2;  // of the value, for each channel
  const double turns = kGoldenSection * number;
  const double hue = 6.0 * (turns - std::floor(turns));
  const double value = kValues[number % kValues.size()];
  const auto channel = [&](double peak) {
    const double off = std::abs(hue - peak);
    const double full = std::clamp(2.0 - std::min(off, 6.0 - off), 0.0, 1.0);
    return static_cast<float>(value * (kMinChannel + (1.0 - kMinChannel) * full));
  };
  return {channel(0.0), channel(2.0), channel(4.0)};
}

Rgb count_color(double count, double most) {
  const double heat = 3.0 * std::min(std::log2(1.0 + count) / std::log2(1.0 + most), 1.0);
  const auto channel = [&](double from) { return static_cast<float>(std::clamp(heat - from, 0.0, 1.0)); };
  return {channel(0.0), channel(1.0), channel(2.0)};
}

}  // namespace hpr
