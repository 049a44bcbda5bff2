#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "image/image_io.h"
#include "image/metrics.h"

namespace hpr {

/// How the colours of two pictures differ, for those metrics that were asked for; the others stay NaN.
struct ColorErrors {
  std::size_t not_finite = 0;  ///< pixels where either colour is not; unless there are none, all below is NaN
  RelativeError relative{std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};
  double ssim = std::numeric_limits<double>::quiet_NaN();
  double flip = std::numeric_limits<double>::quiet_NaN();
};

/// Where R, G and B stand among the channels; three times Y's place in their stead. None for pictures that have
/// neither.
[[nodiscard]] std::optional<std::array<std::size_t, 3>> color_places(const FloatImage& picture);

/// [height][width][3]: channels R, G and B, or three times Y. Empty for pictures that have neither.
[[nodiscard]] std::vector<float> colors_of(const FloatImage& picture);

/// Whether `metric` is one of `metrics`.
[[nodiscard]] bool asks_for(std::span<const std::string> metrics, std::string_view metric);

/// Whether any of `metrics` is about colours: relmse, ssim or flip.
[[nodiscard]] bool asks_for_colors(std::span<const std::string> metrics);

/// Compares `b` with `a`, of the same size and channels: relmse of the values as they are; ssim and flip of display
/// values, which linear pictures are clamped and encoded to. None for pictures without channels R, G and B, or Y.
[[nodiscard]] std::optional<ColorErrors> compare_colors(const FloatImage& a, const FloatImage& b,
                                                        std::span<const std::string> metrics, int threads);

}  // namespace hpr
