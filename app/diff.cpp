#include "app/diff.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/check.h"
#include "core/error.h"
#include "core/file.h"

namespace hpr {
namespace {

/// The values of `picture` with its channels in the order of `channels`.
std::vector<float> in_order(const FloatImage& picture, const std::vector<std::string>& channels) {
  std::vector<std::size_t> from;
  from.reserve(channels.size());
  for (const std::string& channel : channels) {
    from.push_back(static_cast<std::size_t>(std::ranges::find(picture.channels, channel) - picture.channels.begin()));
  }
  std::vector<float> values;
  values.reserve(picture.values.size());
  for (std::size_t pixel = 0; pixel < picture.size.area(); ++pixel) {
    for (const std::size_t channel : from) values.push_back(picture.values[pixel * channels.size() + channel]);
  }
  return values;
}

float distance_of(float a, float b) {
  if (a == b || (std::isnan(a) && std::isnan(b))) return 0.0F;
  const float distance = std::abs(a - b);
  return std::isnan(distance) ? std::numeric_limits<float>::infinity() : distance;
}

bool within(std::size_t beyond, std::size_t pixels, double percent) {
  return 100.0 * static_cast<double>(beyond) <= percent * static_cast<double>(pixels);
}

double share(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0.0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

/// Whether `picture` has all channels of `other` but its alpha.
bool lacks_alpha(const FloatImage& picture, const FloatImage& other) {
  std::vector<std::string> with = picture.channels;
  with.emplace_back("A");
  return std::ranges::find(picture.channels, "A") == picture.channels.end() &&
         std::ranges::is_permutation(with, other.channels);
}

/// The picture with an alpha of 1.
FloatImage opaque(const FloatImage& picture) {
  FloatImage result = picture;
  const std::size_t channels = picture.channels.size();
  result.channels.emplace_back("A");
  result.values.clear();
  result.values.reserve(picture.size.area() * (channels + 1));
  for (std::size_t pixel = 0; pixel < picture.size.area(); ++pixel) {
    const auto from = picture.values.begin() + static_cast<std::ptrdiff_t>(pixel * channels);
    result.values.insert(result.values.end(), from, from + static_cast<std::ptrdiff_t>(channels));
    result.values.push_back(1.0F);
  }
  return result;
}

std::vector<Key> read_keys(const std::filesystem::path& path) {
  constexpr std::uint64_t kLargestFile = std::uint64_t{32} << 30U;
  const std::vector<std::byte> bytes = read_file(path, kLargestFile);
  if (bytes.size() % sizeof(Key) != 0) {
    throw Error(ExitCode::BadInput,
                fmt::format("{}: {} bytes are no whole number of 64-bit keys", path.string(), bytes.size()),
                "write the file with hpr render --raw FILE.keys");
  }
  std::vector<Key> keys(bytes.size() / sizeof(Key));
  std::memcpy(keys.data(), bytes.data(), bytes.size());
  return keys;
}

[[noreturn]] void throw_other_kind(const std::string& a, const std::string& b) {
  throw Error(ExitCode::BadInput, fmt::format("{} and {} are of different kinds", a, b),
              "compare keys with keys, linear EXR with EXR, and sRGB PNG or JPEG with one another");
}

std::string describe(const FloatImage& picture) {
  return fmt::format("{}x{} {}", picture.size.width, picture.size.height, fmt::join(picture.channels, ","));
}

std::size_t worst_x(const DiffReport& report) {
  return report.difference.worst % static_cast<std::size_t>(report.size.width);
}
std::size_t worst_y(const DiffReport& report) {
  return report.difference.worst / static_cast<std::size_t>(report.size.width);
}

/// Null for equal pictures.
nlohmann::ordered_json worst_pixel(const DiffReport& report) {
  if (report.difference.differing == 0) return nullptr;
  return {{"x", worst_x(report)}, {"y", worst_y(report)}, {"value", report.difference.max}};
}

/// What only pictures have. JSON has no infinity and no NaN: null.
void add_picture(nlohmann::ordered_json& json, const DiffReport& report, std::span<const std::string> metrics) {
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
  std::vector<std::string> sorted_a = a.channels;
  std::vector<std::string> sorted_b = b.channels;
  std::ranges::sort(sorted_a);
  std::ranges::sort(sorted_b);
  if (a.size != b.size || sorted_a != sorted_b) {
    throw Error(ExitCode::BadInput, fmt::format("{} is {}, {} is {}", name_a, describe(a), name_b, describe(b)),
                "only pictures of the same size and channels can be compared");
  }
  if (a.linear != b.linear) throw_other_kind(name_a, name_b);
  DiffReport report;
  report.size = a.size;
  report.channels = a.channels;
  const std::size_t channels = a.channels.size();
  if (asks_for_colors(metrics)) report.colors = compare_colors(a, b, metrics, threads);
  const std::vector<float> other = in_order(b, a.channels);
  report.difference = compare_values(other, a.values, channels);
  if (const std::vector<float> colors = colors_of(a); !colors.empty()) {
    const Difference seen = compare_values(colors_of(b), colors, 3);
    report.difference.rmse = seen.rmse;
    report.difference.psnr = seen.psnr;
    report.difference.mean = seen.mean;
    report.difference.mean_error = seen.mean_error;
  }
  report.largest.reserve(report.difference.pixels);
  for (std::size_t pixel = 0; pixel < report.difference.pixels; ++pixel) {
    float largest = 0.0F;
    for (std::size_t i = pixel * channels; i < (pixel + 1) * channels; ++i) {
      largest = std::max(largest, distance_of(a.values[i], other[i]));
    }
    report.largest.push_back(largest);
    if (static_cast<double>(largest) > tolerance.value) ++report.beyond;
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
    const auto depth = static_cast<double>(distance_of(key_depth(a[i]), key_depth(b[i])));
    report.difference.max = std::max(report.difference.max, depth);
  }
  report.beyond = report.difference.differing;
  report.passed = within(report.beyond, a.size(), percent);
  return report;
}

DiffReport diff_files(const std::filesystem::path& a, const std::filesystem::path& b, const DiffTolerance& tolerance,
                      const ImageLimits& limits, std::span<const std::string> metrics, int threads) {
  const bool keys = a.extension() == ".keys";
  if (keys != (b.extension() == ".keys") || (a.extension() == ".exr") != (b.extension() == ".exr")) {
    throw_other_kind(a.string(), b.string());
  }
  if (!keys) {
    return diff_pictures(read_image(a, limits), a.string(), read_image(b, limits), b.string(), tolerance, metrics,
                         threads);
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
  float top = 0.0F;
  for (const float value : report.largest) {
    if (std::isfinite(value)) top = std::max(top, value);
  }
  Image<Rgba8> image(report.size);
  for (std::size_t i = 0; i < report.largest.size(); ++i) {
    const float value = report.largest[i];
    // Even the least difference is seen: colours start a fifth up the ramp.
    constexpr double kLeast = 0.2;
    image.pixels()[i] = value == 0.0F ? Rgba8{0, 0, 0, 255}
                        : !std::isfinite(value)
                            ? Rgba8{0, 255, 255, 255}
                            : heat_color(kLeast + (1.0 - kLeast) * static_cast<double>(value / top));
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
  if (report.beyond != d.differing) row("beyond", fmt::format("{} pixels exceed --fail", report.beyond));
  row("verdict", d.differing == 0 ? "equal" : report.passed ? "within tolerance" : "different");
  return text;
}

std::string diff_json(const DiffReport& report, std::span<const std::string> metrics, const std::string& name_a,
                      const std::string& name_b, const DiffTolerance& tolerance) {
  const Difference& d = report.difference;
  nlohmann::ordered_json json{{"schema", "hpr.diff/1"}, {"a", name_a}, {"b", name_b}};
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
  return json.dump(2, ' ', false, nlohmann::detail::error_handler_t::replace) + "\n";
}

}  // namespace hpr
