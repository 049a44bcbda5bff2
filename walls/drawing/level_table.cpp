#include "walls/drawing/level_table.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace hpr {

LevelTable::LevelTable(const std::function<double(float light)>& level) {
  const auto rounded = [&](float light) { return std::lround(255.0 * std::clamp(level(light), 0.0, 1.0)); };
  // Floats from 0 to 1 rise as their bits do.
  constexpr auto kOne = std::bit_cast<std::uint32_t>(1.0F);
  std::uint32_t from = 0;
  for (std::size_t k = 0; k < 256; ++k) {
    std::uint32_t to = kOne + 1;
    while (from < to) {
      const std::uint32_t middle = from + (to - from) / 2;
      if (rounded(std::bit_cast<float>(middle)) >= static_cast<long>(k)) {
        to = middle;
      } else {
        from = middle + 1;
      }
    }
    least_.at(k) = from > kOne ? std::numeric_limits<float>::infinity() : std::bit_cast<float>(from);
  }
  least_[0] = -std::numeric_limits<float>::infinity();
  least_[256] = std::numeric_limits<float>::infinity();
  for (std::size_t step = 0; step < start_.size(); ++step) {
    const float light = static_cast<float>(step) / kSteps;
    const auto past = std::ranges::upper_bound(least_, light);
    start_.at(step) = static_cast<std::uint8_t>(past - least_.begin() - 1);
  }
}

std::uint8_t LevelTable::operator()(float light) const {
  if (!(light > 0.0F)) return start_.front();
  std::size_t level = start_[static_cast<std::size_t>(std::min(light, 1.0F) * kSteps)];
  while (std::min(light, 1.0F) >= least_[level + 1]) ++level;
  return static_cast<std::uint8_t>(level);
}

}  // namespace hpr
