#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "image/image_io.h"
#include "image/key.h"
#include "image/metrics.h"
#include "tools/diff/diff_colors.h"

namespace hpr {

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
  std::vector<double> largest;  ///< of pictures, per pixel: its largest absolute difference; infinite where one is NaN
};

/// The metrics by name: rmse, psnr, max, differing, mean, relmse, ssim, flip.
[[nodiscard]] const std::vector<std::string>& diff_metrics();
/// Those that take no longer than reading the pictures.
[[nodiscard]] std::vector<std::string> quick_diff_metrics();

/// From black for 0 to pale yellow for 1, in equal steps of lightness.
[[nodiscard]] Rgba8 heat_color(double share);

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

/// The same for files: of keys (a uint64 per pixel, little-endian) or pictures. Throws Error (Io,
/// BadInput, Limit, and Usage for a tolerance of values between keys).
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
