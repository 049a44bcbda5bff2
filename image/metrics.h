#pragma once

#include <cstddef>
#include <span>

namespace hpr {

/// How far `image` is from `reference`, over all values of both (equal in number). Values that are NaN in only one of
/// them count as an infinite difference; NaN in both counts as equal.
struct Difference {
  double rmse = 0.0;          ///< root of the mean squared difference
  double psnr = 0.0;          ///< dB against a peak of 1; infinity when equal
  double max = 0.0;           ///< largest absolute difference
  double mean = 0.0;          ///< signed: mean of image - reference (bias)
  std::size_t pixels = 0;     ///< compared
  std::size_t differing = 0;  ///< pixels with any value whose bits differ by more than -0 against 0
};

/// `channels` values per pixel.
[[nodiscard]] Difference compare_values(std::span<const float> image, std::span<const float> reference,
                                        std::size_t channels);

}  // namespace hpr
