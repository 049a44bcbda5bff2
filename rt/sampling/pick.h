#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

namespace hpr {

struct Picked {
  std::size_t index = 0;
  double probability = 0.0;
  double rest = 0.0;  ///< what is left of the random number, again uniform in [0, 1)
};

/// Chooses i with a probability in proportion to sums[i] - sums[i - 1]. `sums` never falls and ends above 0; what has
/// no share is never chosen. O(log n).
[[nodiscard]] inline Picked pick(std::span<const double> sums, double u) {
  constexpr double kBelowOne = 1.0 - 1.0 / 9007199254740992.0;
  const double target = std::min(u, kBelowOne) * sums.back();
  // The product may round up to the whole sum: then the last one with a share.
  auto found = std::ranges::upper_bound(sums, target);
  if (found == sums.end()) found = std::ranges::lower_bound(sums, sums.back());
  const double before = found == sums.begin() ? 0.0 : *(found - 1);
  const double share = *found - before;
  return {static_cast<std::size_t>(found - sums.begin()), share / sums.back(),
          std::clamp((target - before) / share, 0.0, kBelowOne)};
}

}  // namespace hpr
