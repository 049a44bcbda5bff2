#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "image/image_io.h"
#include "image/key.h"
#include "image/metrics.h"

namespace hpr {

/// How the colours of two pictures differ, for those metrics that were asked for; the others stay NaN.
struct ColorErrors {
  std::size_t not_finite = 0;  ///< pixels where either colour is not; unless there are none, all below is NaN
  RelativeError relative{std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};
  double ssim = std::numeric_limits<double>::quiet_NaN();
  double flip = std::numeric_limits<double>::quiet_NaN();
};

/// The indices of channels R, G and B, or three times that of Y. None for pictures that have neither.
[[nodiscard]] std::optional<std::array<std::size_t, 3>> color_channels(const FloatImage& picture);

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

/// What may differ before two files count as different.
struct DiffTolerance {
  double value = 0.0;    ///< largest absolute difference per value
  double percent = 0.0;  ///< of all pixels: how many may exceed it
};

/// How two pictures, or two files of keys, differ.
struct DiffReport {
  bool keys = false;
  Size size;                          ///< of pictures; files of keys do not know theirs
  std::vector<std::string> channels;  ///< of pictures
  Difference difference;              ///< of keys: only pixels, differing, and `max`, of the depths
  std::optional<ColorErrors> colors;  ///< of pictures: where they were asked for and there are any
  std::size_t other_surface = 0;      ///< of keys: pixels that show another surface
  std::size_t beyond = 0;             ///< pixels with a value past the tolerance
  bool passed = true;
  std::array<PngTexts, 2> texts;  ///< of pictures: what `a` and `b` say about themselves
  std::vector<double> largest;  ///< of pictures, per pixel: its largest absolute difference; infinite where one is NaN
};

/// The metrics by name: rmse, psnr, max, differing, mean, relmse, ssim, flip.
[[nodiscard]] const std::vector<std::string>& diff_metrics();
/// The metrics that take no longer than reading the pictures.
[[nodiscard]] std::vector<std::string> quick_diff_metrics();

/// Compares `b` with `a` value by value (integers by their bits, levels of 8 and 16 bits as such), channels by name,
/// and colours as far as `metrics` asks for them. Where only one has alpha, the other's is 1. rmse, psnr and mean are
/// of colours where there are any. Throws Error (BadInput), naming both, when sizes or channels differ, or one is
/// linear and the other is not.
[[nodiscard]] DiffReport diff_pictures(const FloatImage& a, const std::string& name_a, const FloatImage& b,
                                       const std::string& name_b, const DiffTolerance& tolerance,
                                       std::span<const std::string> metrics = diff_metrics(), int threads = 1);

/// Compares two equally long lists of keys; every differing key is past the tolerance.
[[nodiscard]] DiffReport diff_keys(std::span<const Key> a, std::span<const Key> b, double percent);

/// Whether a file is one of keys, by its extension: .keys, in letters of any size.
[[nodiscard]] bool is_keys(const std::filesystem::path& file);

/// Compares two files of keys (a uint64 per pixel, little-endian), or two of pictures. Throws Error (Io, BadInput,
/// Limit, and Usage for a tolerance of values between keys).
[[nodiscard]] DiffReport diff_files(const std::filesystem::path& a, const std::filesystem::path& b,
                                    const DiffTolerance& tolerance, const ImageLimits& limits,
                                    std::span<const std::string> metrics = diff_metrics(), int threads = 1);

/// Where pictures differ and how much: black where equal, then from violet over red and orange to pale yellow at the
/// largest finite difference, lighter meaning more; cyan where only one of both is finite.
[[nodiscard]] Image<Rgba8> heat_map(const DiffReport& report);

/// What the command prints. `metrics` are those that the report was made for.
[[nodiscard]] std::string diff_table(const DiffReport& report, std::span<const std::string> metrics);
[[nodiscard]] std::string diff_json(const DiffReport& report, std::span<const std::string> metrics,
                                    const std::string& name_a, const std::string& name_b,
                                    const DiffTolerance& tolerance);

}  // namespace hpr
