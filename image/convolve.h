#pragma once

#include <span>

#include "image/image.h"

namespace hpr {

/// The two turns of a separable filter over one channel. Only places where the filter lies whole inside `in` are kept,
/// so the result is narrower, or lower, by weights.size() - 1, and how a picture goes on beyond its border is decided
/// by whoever makes `in`. `in` must be as large as the filter at least; every value is summed in the order of the
/// weights. For float and double.

/// out(x, y) = sum over i of weights[i] in(x + i, y)
template <typename Real>
[[nodiscard]] Image<Real> filter_rows(const Image<Real>& in, std::span<const Real> weights);

/// out(x, y) = sum over i of weights[i] in(x, y + i)
template <typename Real>
[[nodiscard]] Image<Real> filter_columns(const Image<Real>& in, std::span<const Real> weights);

/// Pictures are filtered in bands of so many rows, each with the rows above and below that its filter needs: what lies
/// between two filters stays in the cache, and threads take bands.
inline constexpr int kBandRows = 64;

[[nodiscard]] constexpr std::size_t band_count(int rows) {
  return static_cast<std::size_t>((rows + kBandRows - 1) / kBandRows);
}

}  // namespace hpr
