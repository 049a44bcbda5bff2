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
#include "core/text.h"
#include "image/color.h"
#include "image/flip.h"
#include "image/metrics.h"
#include "image/tone.h"
#include "tools/report/canvas.h"
#include "tools/report/table.h"

namespace hpr {
namespace {

std::size_t not_finite_pixels(std::span<const float> a, std::span<const float> b) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.size(); i += 3) {
    if (!all_finite(a.subspan(i, 3)) || !all_finite(b.subspan(i, 3))) ++count;
  }
  return count;
}

/// The levels that pictures of 8 and 16 bits are compared in: levels of 8 bits are 257 of them apart.
constexpr std::uint32_t kMaxLevels = 0xFFFF;

std::string describe(const FloatImage& picture) {
  return fmt::format("{}x{} {}", picture.size.width, picture.size.height, fmt::join(picture.channels, ","));
}

std::size_t channel_index(const FloatImage& picture, const std::string& channel) {
  return static_cast<std::size_t>(std::ranges::find(picture.channels, channel) - picture.channels.begin());
}

/// The level that `value` stands for, of kMaxLevels.
double level_of(float value, std::uint32_t levels) {
  const std::uint32_t apart = kMaxLevels / levels;
  return std::round(static_cast<double>(value) * levels) * apart;
}

/// One channel of `image` - `reference` into every `stride`th value.
void subtract(const FloatImage& image, const FloatImage& reference, const std::string& channel,
              std::span<double> differences) {
  const std::size_t stride = reference.channels.size();
  const std::size_t from = channel_index(image, channel);
  const std::size_t to = channel_index(reference, channel);
  const bool leveled = image.levels > 0 && reference.levels > 0;
  const auto integers = image.integers.find(channel);
  for (std::size_t pixel = 0; pixel < reference.size.area(); ++pixel) {
    double& difference = differences[pixel * stride + to];
    const float a = image.values[pixel * stride + from];
    const float b = reference.values[pixel * stride + to];
    if (integers != image.integers.end()) {
      difference =
          static_cast<double>(integers->second[pixel]) - static_cast<double>(reference.integers.at(channel)[pixel]);
    } else if (leveled) {
      difference = (level_of(a, image.levels) - level_of(b, reference.levels)) / kMaxLevels;
    } else {
      difference = difference_of(a, b);
    }
  }
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

/// Whether both are made of levels, 8 bits of them in one and 16 in the other.
bool differ_in_levels(const FloatImage& a, const FloatImage& b) {
  return a.levels > 0 && b.levels > 0 && a.levels != b.levels;
}

/// The picture, of 8 or 16 bits, with values and levels as 16 bits have them.
FloatImage on_max_levels(const FloatImage& picture) {
  FloatImage result = picture;
  result.levels = kMaxLevels;
  std::ranges::transform(picture.values, result.values.begin(),
                         [&](float value) { return static_cast<float>(level_of(value, picture.levels) / kMaxLevels); });
  return result;
}

[[noreturn]] void throw_other_kind(const std::string& a, const std::string& b) {
  throw Error(
      ExitCode::BadInput, fmt::format("{} and {} are of different kinds", a, b),
      "compare keys (FILE.keys) with keys, linear EXR and Radiance with one another, and sRGB PNG and JPEG likewise");
}

/// Throws Error (BadInput), naming both, unless sizes, channels and what these hold are the same.
void check_comparable(const FloatImage& a, const std::string& name_a, const FloatImage& b, const std::string& name_b) {
  if (a.size != b.size || !std::ranges::is_permutation(a.channels, b.channels)) {
    throw Error(ExitCode::BadInput, fmt::format("{} is {}, {} is {}", name_a, describe(a), name_b, describe(b)),
                "only pictures of the same size and channels can be compared");
  }
  if (a.linear != b.linear) throw_other_kind(name_a, name_b);
  for (const std::string& channel : a.channels) {
    if (a.integers.contains(channel) == b.integers.contains(channel)) continue;
    const bool first = a.integers.contains(channel);
    throw Error(ExitCode::BadInput,
                fmt::format("channel {} holds integers in {} and other numbers in {}", printable(channel),
                            first ? name_a : name_b, first ? name_b : name_a),
                "write both pictures by the same program");
  }
}

/// image - reference (difference_of), [height][width][channels] in the order of the reference's channels, rounded once:
/// levels and integers are subtracted as such; a difference of integers is a whole number.
std::vector<double> picture_differences(const FloatImage& image, const FloatImage& reference) {
  std::vector<double> differences(reference.values.size());
  for (const std::string& channel : reference.channels) subtract(image, reference, channel, differences);
  return differences;
}

/// [pixels][3] of [pixels][channels]: the values at these places of each pixel.
std::vector<double> only(std::span<const double> values, std::size_t channels,
                         const std::array<std::size_t, 3>& indices) {
  std::vector<double> chosen;
  chosen.reserve(values.size() / channels * indices.size());
  for (std::size_t first = 0; first < values.size(); first += channels) {
    for (const std::size_t index : indices) chosen.push_back(values[first + index]);
  }
  return chosen;
}

bool within(std::size_t beyond, std::size_t pixels, double percent) {
  return 100.0 * static_cast<double>(beyond) <= percent * static_cast<double>(pixels);
}

double percentage(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0.0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

std::vector<Key> read_keys(const std::filesystem::path& path) {
  constexpr std::uint64_t kMaxFileBytes = std::uint64_t{32} << 30U;
  const std::vector<std::byte> bytes = read_file(path, kMaxFileBytes);
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
    return fmt::format("{} of {} pixels ({:.4g} %)", d.differing, d.pixels, percentage(d.differing, d.pixels));
  }
  if (metric == "mean") {
    const std::string mean = fmt::format("{:+.6g}", d.mean);
    return std::isfinite(d.mean_error) ? fmt::format("{} +- {:.2g}", mean, d.mean_error) : mean;
  }
  return color_value(report.colors, metric);
}

}  // namespace

std::optional<std::array<std::size_t, 3>> color_channels(const FloatImage& picture) {
  const auto index = [&](const char* channel) { return channel_index(picture, channel); };
  const std::size_t none = picture.channels.size();
  std::array<std::size_t, 3> indices{index("R"), index("G"), index("B")};
  if (std::ranges::count(indices, none) != 0) indices.fill(index("Y"));
  if (indices[0] == none) return std::nullopt;
  return indices;
}

std::vector<float> colors_of(const FloatImage& picture) {
  const auto indices = color_channels(picture);
  if (!indices) return {};
  std::vector<float> colors;
  colors.reserve(picture.size.area() * indices->size());
  for (std::size_t pixel = 0; pixel < picture.size.area(); ++pixel) {
    for (const std::size_t index : *indices) colors.push_back(picture.values[pixel * picture.channels.size() + index]);
  }
  return colors;
}

bool asks_for(std::span<const std::string> metrics, std::string_view metric) {
  return std::ranges::find(metrics, metric) != metrics.end();
}

bool asks_for_colors(std::span<const std::string> metrics) {
  return asks_for(metrics, "relmse") || asks_for(metrics, "ssim") || asks_for(metrics, "flip");
}

std::optional<ColorErrors> compare_colors(const FloatImage& a, const FloatImage& b,
                                          std::span<const std::string> metrics, int threads) {
  std::vector<float> reference = colors_of(a);
  std::vector<float> image = colors_of(b);
  if (reference.empty() && a.size.area() > 0) return std::nullopt;
  ColorErrors errors;
  errors.not_finite = not_finite_pixels(reference, image);
  if (errors.not_finite > 0) return errors;
  if (asks_for(metrics, "relmse")) errors.relative = relative_error(image, reference, 3);
  if (a.linear) {
    for (std::vector<float>* const values : {&reference, &image})
      std::ranges::transform(*values, values->begin(), encode_srgb);
  }
  if (asks_for(metrics, "ssim")) errors.ssim = ssim(image, reference, a.size, threads);
  if (asks_for(metrics, "flip")) errors.flip = flip_error(image, reference, a.size, threads).mean;
  return errors;
}

bool is_keys(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return std::tolower(c); });
  return extension == ".keys";
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
    return diff_pictures(on_max_levels(a), name_a, on_max_levels(b), name_b, tolerance, metrics, threads);
  check_comparable(a, name_a, b, name_b);
  DiffReport report;
  report.size = a.size;
  report.channels = a.channels;
  report.texts = {a.texts, b.texts};
  const std::size_t channels = a.channels.size();
  if (asks_for_colors(metrics)) report.colors = compare_colors(a, b, metrics, threads);
  const std::vector<double> differences = picture_differences(b, a);
  report.difference = summarize_differences(differences, channels);
  if (const auto indices = color_channels(a)) {
    const Difference color_difference = summarize_differences(only(differences, channels, *indices), indices->size());
    report.difference.rmse = color_difference.rmse;
    report.difference.psnr = color_difference.psnr;
    report.difference.mean = color_difference.mean;
    report.difference.mean_error = color_difference.mean_error;
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
    constexpr double kMinFraction = 0.2;
    image.pixels()[i] = value == 0.0            ? Rgba8{0, 0, 0, 255}
                        : !std::isfinite(value) ? Rgba8{0, 255, 255, 255}
                                                : heat_color(kMinFraction + (1.0 - kMinFraction) * (value / top));
  }
  return image;
}

namespace {

/// What a picture says about itself; "unknown" where it does not.
std::string said_in(const PngTexts& texts, const std::string& keyword) {
  const auto found = texts.find(keyword);
  return found == texts.end() ? "unknown" : printable(found->second, 40);
}

/// How display colours were made (engine's DisplayTransform), by the word for it: of pictures that say so.
constexpr std::array<std::pair<const char*, const char*>, 2> kDisplayTexts{
    {{"tone", kToneText}, {"exposure", kExposureText}}};

bool says(const DiffReport& report, const std::string& keyword) {
  return std::ranges::any_of(report.texts, [&](const PngTexts& texts) { return texts.contains(keyword); });
}

}  // namespace

std::string diff_table(const DiffReport& report, std::span<const std::string> metrics) {
  const Difference& d = report.difference;
  using Row = std::pair<std::string, std::string>;
  std::vector<Row> rows;
  const auto row = [&](std::string name, std::string value) { rows.emplace_back(std::move(name), std::move(value)); };
  if (report.keys) {
    if (asks_for(metrics, "max")) row("max", fmt::format("{:.6g} of depth", d.max));
    if (asks_for(metrics, "differing")) {
      row("differing", fmt::format("{} of {} keys ({:.4g} %), {} of them another surface", d.differing, d.pixels,
                                   percentage(d.differing, d.pixels), report.other_surface));
    }
  } else {
    row("size", fmt::format("{}x{} {}", report.size.width, report.size.height, fmt::join(report.channels, ",")));
    for (const auto& [word, keyword] : kDisplayTexts) {
      const std::string a = said_in(report.texts[0], keyword);
      const std::string b = said_in(report.texts[1], keyword);
      if (says(report, keyword)) row(word, a == b ? a : fmt::format("{} in A, {} in B", a, b));
    }
    for (const std::string& metric : diff_metrics()) {
      if (asks_for(metrics, metric)) row(metric, picture_value(report, metric));
    }
  }
  if (!report.keys || report.beyond != d.differing)
    row("beyond", fmt::format("{} pixels exceed --fail", report.beyond));
  row("verdict", d.differing == 0 ? "equal" : report.passed ? "within tolerance" : "different");
  const std::vector<Column<Row>> columns{field<Row>("name", &Row::first, {.align = Align::Left, .width = 10}),
                                         field<Row>("value", &Row::second, {.align = Align::Left})};
  return Table(columns, std::span<const Row>(rows)).text({"name", "value"});
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
    for (const auto& [word, keyword] : kDisplayTexts) {
      if (says(report, keyword))
        json[word] = Json::array({said_in(report.texts[0], keyword), said_in(report.texts[1], keyword)});
    }
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
