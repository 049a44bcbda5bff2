#include "image/color.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <vector>

namespace hpr {
namespace {

/// IEC 61966-2-1.
template <typename Real>
Real decode(Real level) {
  return level <= Real(0.04045) ? level / Real(12.92) : std::pow((level + Real(0.055)) / Real(1.055), Real(2.4));
}

/// The smallest float from which level i + 1 is nearer than level i.
std::array<float, 255> find_thresholds() {
  std::array<float, 255> made{};
  for (std::size_t i = 0; i < made.size(); ++i) {
    const double border = decode((static_cast<double>(i) + 0.5) / 255.0);
    made[i] = static_cast<float>(border);
    if (static_cast<double>(made[i]) < border) made[i] = std::nextafter(made[i], 2.0F);
  }
  return made;
}

/// Where to begin counting thresholds: floats that share their upper 16 bits lie within 1/128 of each other, with two
/// thresholds among them at most.
struct Levels {
  static constexpr std::uint32_t kShift = 16;

  std::array<float, 255> thresholds = find_thresholds();
  std::uint32_t first = std::bit_cast<std::uint32_t>(thresholds.front()) >> kShift;
  std::vector<std::uint8_t> starts;

  Levels() {
    const std::uint32_t last = std::bit_cast<std::uint32_t>(thresholds.back()) >> kShift;
    for (std::uint32_t upper = first; upper <= last; ++upper) {
      const auto least = std::bit_cast<float>(upper << kShift);
      const auto above = std::ranges::partition_point(thresholds, [&](float t) { return t <= least; });
      starts.push_back(static_cast<std::uint8_t>(above - thresholds.begin()));
    }
  }
};

std::uint8_t encode(float linear) {
  // Counting thresholds instead of calling pow makes the level exact and the same on every machine. NaN counts none.
  static const Levels levels;
  if (!(linear >= levels.thresholds.front())) return 0;
  if (linear >= levels.thresholds.back()) return 255;
  std::size_t level = levels.starts[(std::bit_cast<std::uint32_t>(linear) >> Levels::kShift) - levels.first];
  while (levels.thresholds[level] <= linear) ++level;
  return static_cast<std::uint8_t>(level);
}

}  // namespace

Rgba8 to_srgb(Rgb linear) {
  return {encode(linear.r), encode(linear.g), encode(linear.b), 255};
}

float srgb_to_linear(std::uint8_t level) {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> made{};
    for (std::size_t i = 0; i < made.size(); ++i) made[i] = static_cast<float>(decode(static_cast<double>(i) / 255.0));
    return made;
  }();
  return table[level];
}

float encode_srgb(float linear) {
  const float value = std::clamp(linear, 0.0F, 1.0F);
  return value <= 0.0031308F ? 12.92F * value : 1.055F * std::pow(value, 1.0F / 2.4F) - 0.055F;
}

float decode_srgb(float display) {
  return decode(std::clamp(display, 0.0F, 1.0F));
}

}  // namespace hpr
