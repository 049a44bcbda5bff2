#pragma once

#include <cstddef>
#include <span>

#include "image/image.h"

namespace hpr {

/// How far `image` is from `reference`, over all values of both (equal in number). Values that are NaN in only one of
/// them count as an infinite difference; NaN in both counts as equal.
struct Difference {
  double rmse = 0.0;          ///< root of the mean squared difference
  double psnr = 0.0;          ///< dB against a peak of 1; infinity when equal
  double max = 0.0;           ///< largest absolute difference
  double mean = 0.0;          ///< signed: mean of image - reference (bias)
  double mean_error = 0.0;    ///< standard error of `mean`, pixels taken as independent; NaN for fewer than two
  std::size_t worst = 0;      ///< the first pixel with a difference of `max`
  std::size_t pixels = 0;     ///< compared
  std::size_t differing = 0;  ///< pixels with any value whose bits differ by more than -0 against 0
};

/// Subtracts b from a; infinite where only one of both is NaN, 0 where both are.
[[nodiscard]] double difference_of(double a, double b);

/// Summarizes differences, image - reference: `channels` values per pixel, made by difference_of.
[[nodiscard]] Difference summarize_differences(std::span<const double> differences, std::size_t channels);

/// `channels` values per pixel.
[[nodiscard]] Difference compare_values(std::span<const float> image, std::span<const float> reference,
                                        std::size_t channels);

/// relMSE: squared differences against the squared brightness of the reference, the mean over all pixels and channels
/// of (image - reference)^2 / (m^2 + 0.01), where m is the mean of the reference's channels in that pixel. Of noise it
/// falls as 1 / samples.
struct RelativeError {
  double trimmed = 0.0;  ///< without the worst pixels, one in 1000 (rounded down): fireflies say little of the rest
  double all = 0.0;
};

/// `channels` values per pixel. NaN where a value is not finite, 0 without pixels.
[[nodiscard]] RelativeError relative_error(std::span<const float> image, std::span<const float> reference,
                                           std::size_t channels);

/// Whether no value is infinite or NaN.
[[nodiscard]] bool all_finite(std::span<const float> values);

/// Structural similarity (Wang, Bovik, Sheikh, Simoncelli, "Image Quality Assessment: From Error Visibility to
/// Structural Similarity", 2004): 1 for equal pictures, less the more they differ, symmetric. Gaussian window of 11 x
/// 11 pixels, standard deviation 1.5, K1 = 0.01, K2 = 0.03; the mean over the channels and over all windows that lie
/// whole in the picture. A picture narrower or lower than the window is reflected at its borders instead, and every
/// pixel is the centre of a window.
///
/// Both [height][width][3] display values in [0, 1]. NaN where a value is not finite; 1 without pixels. The same bits
/// for any number of threads.
[[nodiscard]] double ssim(std::span<const float> image, std::span<const float> reference, Size size, int threads);

}  // namespace hpr
