#include "tools/diff/diff.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstring>
#include <limits>

#include "core/error.h"
#include "core/file.h"
#include "core/json.h"
#include "tools/diff/diff_values.h"

namespace hpr {
namespace {

bool within(std::size_t beyond, std::size_t pixels, double percent) {
  return 100.0 * static_cast<double>(beyond) <= percent * static_cast<double>(pixels);
}

double share(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0.0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

std::vector<Key> read_keys(const std::filesystem::path& path) {
  constexpr std::uint64_t kLargestFile = std::uint64_t{32} << 30U;
  const std::vector<std::byte> bytes = read_file(path, kLargestFile);
  if (bytes.empty() || bytes.size() % sizeof(Key) != 0) {
    throw Error(ExitCode::BadInput,
                bytes.empty()
                    ? fmt::format("{}: an empty file holds no keys", path.string())
                    : fmt::format("{}: {} bytes are no whole number of 64-bit keys", path.string(), bytes.size()),
                "write the file with hpr render --raw FILE.keys");
  }
  std::vector<Key> keys(bytes.size() / sizeof(Key));
  std::memcpy(keys.data(), bytes.data(), bytes.size());
  return keys;
}

/// A file of keys of another name is taken for a picture.
FloatImage read_picture(const std::filesystem::path& path, const ImageLimits& limits) {
  try {
    return read_image(path, limits);
  } catch (const Error& error) {
    if (error.code() != ExitCode::BadInput) throw;
    throw Error(ExitCode::BadInput, error.what(), error.hint() + "; files of keys are known by their name, FILE.keys",
                error.line());
  }
}

std::size_t worst_x(const DiffReport& report) {
  return report.difference.worst % static_cast<std::size_t>(report.size.width);
}
std::size_t worst_y(const DiffReport& report) {
  return report.difference.worst / static_cast<std::size_t>(report.size.width);
}

/// Null for equal pictures.
Json worst_pixel(const DiffReport& report) {
  if (report.difference.differing == 0) return nullptr;
  return {{"x", worst_x(report)}, {"y", worst_y(report)}, {"value", report.difference.max}};
}

/// What only pictures have. JSON has no infinity and no NaN: null.
void add_picture(Json& json, const DiffReport& report, std::span<const std::string> metrics) {
  const Difference& d = report.difference;
  json["width"] = report.size.width;
  json["height"] = report.size.height;
  json["channels"] = report.channels;
  if (asks_for(metrics, "rmse")) json["rmse"] = d.rmse;
  if (asks_for(metrics, "psnr")) json["psnr"] = d.psnr;
  if (asks_for(metrics, "mean")) json["mean"] = d.mean;
  if (asks_for(metrics, "mean")) json["mean_error"] = d.mean_error;
  const ColorErrors colors = report.colors.value_or(ColorErrors{});
  if (asks_for(metrics, "relmse")) json["relmse"] = colors.relative.trimmed;
  if (asks_for(metrics, "relmse")) json["relmse_untrimmed"] = colors.relative.all;
  if (asks_for(metrics, "ssim")) json["ssim"] = colors.ssim;
  if (asks_for(metrics, "flip")) json["flip"] = colors.flip;
  if (asks_for_colors(metrics)) json["not_finite"] = colors.not_finite;
}

std::string color_value(const std::optional<ColorErrors>& colors, const std::string& metric) {
  if (!colors) return "none: the pictures have no channels R, G and B";
  if (colors->not_finite > 0) return fmt::format("none: {} pixels are not finite", colors->not_finite);
  if (metric == "ssim") return fmt::format("{:.6g}", colors->ssim);
  if (metric == "flip") return fmt::format("{:.6g}", colors->flip);
  return fmt::format("{:.6g} ({:.6g} with the worst 0.1 %)", colors->relative.trimmed, colors->relative.all);
}

/// What stands behind the name of a metric in the table of pictures.
std::string picture_value(const DiffReport& report, const std::string& metric) {
  const Difference& d = report.difference;
  if (metric == "rmse") return fmt::format("{:.6g}", d.rmse);
  if (metric == "psnr") return fmt::format("{:.4g} dB", d.psnr);
  if (metric == "max") {
    const std::string largest = fmt::format("{:.6g}", d.max);
    return d.differing == 0 ? largest : fmt::format("{} at {},{}", largest, worst_x(report), worst_y(report));
  }
  if (metric == "differing") {
    return fmt::format("{} of {} pixels ({:.4g} %)", d.differing, d.pixels, share(d.differing, d.pixels));
  }
  if (metric == "mean") {
    const std::string mean = fmt::format("{:+.6g}", d.mean);
    return std::isfinite(d.mean_error) ? fmt::format("{} +- {:.2g}", mean, d.mean_error) : mean;
  }
  return color_value(report.colors, metric);
}

}  // namespace

bool is_keys(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return std::tolower(c); });
  return extension == ".keys";
}

Rgba8 heat_color(double share) {
  constexpr std::array<std::array<double, 3>, 6> kStops{
      {{0, 0, 0}, {52, 18, 108}, {133, 26, 110}, {208, 65, 62}, {247, 148, 34}, {252, 250, 192}}};
  const double place = std::clamp(share, 0.0, 1.0) * (kStops.size() - 1);
  const std::size_t stop = std::min(static_cast<std::size_t>(place), kStops.size() - 2);
  const double f = place - static_cast<double>(stop);
  const auto level = [&](std::size_t channel) {
    return static_cast<std::uint8_t>(std::lround((1.0 - f) * kStops[stop][channel] + f * kStops[stop + 1][channel]));
  };
  return {level(0), level(1), level(2), 255};
}

const std::vector<std::string>& diff_metrics() {
  static const std::vector<std::string> names{"rmse", "psnr", "max", "differing", "mean", "relmse", "ssim", "flip"};
  return names;
}

std::vector<std::string> quick_diff_metrics() {
  std::vector<std::string> names = diff_metrics();
  std::erase_if(names, [](const std::string& name) { return name == "ssim" || name == "flip"; });
  return names;
}

DiffReport diff_pictures(const FloatImage& a, const std::string& name_a, const FloatImage& b, const std::string& name_b,
                         const DiffTolerance& tolerance, std::span<const std::string> metrics, int threads) {
  if (lacks_alpha(a, b)) return diff_pictures(opaque(a), name_a, b, name_b, tolerance, metrics, threads);
  if (lacks_alpha(b, a)) return diff_pictures(a, name_a, opaque(b), name_b, tolerance, metrics, threads);
  if (differ_in_levels(a, b))
    return diff_pictures(on_most_levels(a), name_a, on_most_levels(b), name_b, tolerance, metrics, threads);
  check_comparable(a, name_a, b, name_b);
  DiffReport report;
  report.size = a.size;
  report.channels = a.channels;
  const std::size_t channels = a.channels.size();
  if (asks_for_colors(metrics)) report.colors = compare_colors(a, b, metrics, threads);
  const std::vector<double> differences = picture_differences(b, a);
  report.difference = summarize_differences(differences, channels);
  if (const auto places = color_places(a)) {
    const Difference seen = summarize_differences(only(differences, channels, *places), places->size());
    report.difference.rmse = seen.rmse;
    report.difference.psnr = seen.psnr;
    report.difference.mean = seen.mean;
    report.difference.mean_error = seen.mean_error;
  }
  report.largest.reserve(report.difference.pixels);
  for (std::size_t first = 0; first < differences.size(); first += channels) {
    double largest = 0.0;
    for (const double value : std::span(differences).subspan(first, channels))
      largest = std::max(largest, std::abs(value));
    report.largest.push_back(largest);
    if (largest > tolerance.value) ++report.beyond;
  }
  report.passed = within(report.beyond, report.difference.pixels, tolerance.percent);
  return report;
}

DiffReport diff_keys(std::span<const Key> a, std::span<const Key> b, double percent) {
  HPR_CHECK(a.size() == b.size());
  DiffReport report;
  report.keys = true;
  report.difference.pixels = a.size();
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i] == b[i]) continue;
    ++report.difference.differing;
    if (static_cast<std::uint32_t>(a[i]) != static_cast<std::uint32_t>(b[i])) ++report.other_surface;
    const double depth = difference_of(key_depth(a[i]), key_depth(b[i]));
    report.difference.max = std::max(report.difference.max, std::abs(depth));
  }
  report.beyond = report.difference.differing;
  report.passed = within(report.beyond, a.size(), percent);
  return report;
}

DiffReport diff_files(const std::filesystem::path& a, const std::filesystem::path& b, const DiffTolerance& tolerance,
                      const ImageLimits& limits, std::span<const std::string> metrics, int threads) {
  const bool keys = is_keys(a);
  if (keys != is_keys(b)) throw_other_kind(a.string(), b.string());
  if (!keys) {
    const FloatImage picture_a = read_picture(a, limits);
    return diff_pictures(picture_a, a.string(), read_picture(b, limits), b.string(), tolerance, metrics, threads);
  }
  if (tolerance.value != 0.0) {
    throw Error(ExitCode::Usage, "--fail is for values of pictures; keys are equal or not",
                "use --fail-percent to allow some pixels to differ");
  }
  const std::vector<Key> keys_a = read_keys(a);
  const std::vector<Key> keys_b = read_keys(b);
  if (keys_a.size() != keys_b.size()) {
    throw Error(ExitCode::BadInput,
                fmt::format("{} has {} keys, {} has {}", a.string(), keys_a.size(), b.string(), keys_b.size()),
                "only frames of the same size can be compared");
  }
  return diff_keys(keys_a, keys_b, tolerance.percent);
}

Image<Rgba8> heat_map(const DiffReport& report) {
  HPR_CHECK(!report.keys);
  double top = 0.0;
  for (const double value : report.largest) {
    if (std::isfinite(value)) top = std::max(top, value);
  }
  Image<Rgba8> image(report.size);
  for (std::size_t i = 0; i < report.largest.size(); ++i) {
    const double value = report.largest[i];
    // Even the least difference is seen: colours start a fifth up the ramp.
    constexpr double kLeast = 0.2;
    image.pixels()[i] = value == 0.0            ? Rgba8{0, 0, 0, 255}
                        : !std::isfinite(value) ? Rgba8{0, 255, 255, 255}
                                                : heat_color(kLeast + (1.0 - kLeast) * (value / top));
  }
  return image;
}

std::string diff_table(const DiffReport& report, std::span<const std::string> metrics) {
  const Difference& d = report.difference;
  std::string text;
  const auto row = [&](const char* name, const std::string& value) { text += fmt::format("{:<10} {}\n", name, value); };
  if (report.keys) {
    if (asks_for(metrics, "max")) row("max", fmt::format("{:.6g} of depth", d.max));
    if (asks_for(metrics, "differing")) {
      row("differing", fmt::format("{} of {} keys ({:.4g} %), {} of them another surface", d.differing, d.pixels,
                                   share(d.differing, d.pixels), report.other_surface));
    }
  } else {
    row("size", fmt::format("{}x{} {}", report.size.width, report.size.height, fmt::join(report.channels, ",")));
    for (const std::string& metric : diff_metrics()) {
      if (asks_for(metrics, metric)) row(metric.c_str(), picture_value(report, metric));
    }
  }
  if (!report.keys || report.beyond != d.differing)
    row("beyond", fmt::format("{} pixels exceed --fail", report.beyond));
  row("verdict", d.differing == 0 ? "equal" : report.passed ? "within tolerance" : "different");
  return text;
}

std::string diff_json(const DiffReport& report, std::span<const std::string> metrics, const std::string& name_a,
                      const std::string& name_b, const DiffTolerance& tolerance) {
  const Difference& d = report.difference;
  Json json{{"schema", "hpr.diff/1"}, {"a", name_a}, {"b", name_b}};
  json["kind"] = report.keys ? "keys" : "picture";
  json["pixels"] = d.pixels;
  if (report.keys) {
    json["other_surface"] = report.other_surface;
  } else {
    add_picture(json, report, metrics);
  }
  if (asks_for(metrics, "max")) json["max"] = d.max;
  if (asks_for(metrics, "max") && !report.keys) json["worst"] = worst_pixel(report);
  if (asks_for(metrics, "differing")) json["differing"] = d.differing;
  json["fail"] = tolerance.value;
  json["fail_percent"] = tolerance.percent;
  json["beyond"] = report.beyond;
  json["passed"] = report.passed;
  return json.dump(2) + "\n";
}

}  // namespace hpr
