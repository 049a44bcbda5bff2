#include "tools/diff/diff_values.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/text.h"
#include "image/metrics.h"

namespace hpr {
namespace {

/// Of 8 and 16 bits alike: levels of 8 bits are each 257 of them apart.
constexpr std::uint32_t kMostLevels = 0xFFFF;

std::string describe(const FloatImage& picture) {
  return fmt::format("{}x{} {}", picture.size.width, picture.size.height, fmt::join(picture.channels, ","));
}

std::size_t place_of(const FloatImage& picture, const std::string& channel) {
  return static_cast<std::size_t>(std::ranges::find(picture.channels, channel) - picture.channels.begin());
}

/// The level that `value` stands for, of kMostLevels.
double level_of(float value, std::uint32_t levels) {
  const std::uint32_t apart = kMostLevels / levels;
  return std::round(static_cast<double>(value) * levels) * apart;
}

/// One channel of `image` - `reference` into every `stride`th value.
void subtract(const FloatImage& image, const FloatImage& reference, const std::string& channel,
              std::span<double> differences) {
  const std::size_t stride = reference.channels.size();
  const std::size_t from = place_of(image, channel);
  const std::size_t to = place_of(reference, channel);
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
      difference = (level_of(a, image.levels) - level_of(b, reference.levels)) / kMostLevels;
    } else {
      difference = difference_of(a, b);
    }
  }
}

}  // namespace

bool lacks_alpha(const FloatImage& picture, const FloatImage& other) {
  std::vector<std::string> with = picture.channels;
  with.emplace_back("A");
  return std::ranges::find(picture.channels, "A") == picture.channels.end() &&
         std::ranges::is_permutation(with, other.channels);
}

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

bool differ_in_levels(const FloatImage& a, const FloatImage& b) {
  return a.levels > 0 && b.levels > 0 && a.levels != b.levels;
}

FloatImage on_most_levels(const FloatImage& picture) {
  FloatImage result = picture;
  result.levels = kMostLevels;
  std::ranges::transform(picture.values, result.values.begin(), [&](float value) {
    return static_cast<float>(level_of(value, picture.levels) / kMostLevels);
  });
  return result;
}

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

void throw_other_kind(const std::string& a, const std::string& b) {
  throw Error(
      ExitCode::BadInput, fmt::format("{} and {} are of different kinds", a, b),
      "compare keys (FILE.keys) with keys, linear EXR and Radiance with one another, and sRGB PNG and JPEG likewise");
}

std::vector<double> picture_differences(const FloatImage& image, const FloatImage& reference) {
  std::vector<double> differences(reference.values.size());
  for (const std::string& channel : reference.channels) subtract(image, reference, channel, differences);
  return differences;
}

std::vector<double> only(std::span<const double> values, std::size_t channels,
                         const std::array<std::size_t, 3>& places) {
  std::vector<double> chosen;
  chosen.reserve(values.size() / channels * places.size());
  for (std::size_t first = 0; first < values.size(); first += channels) {
    for (const std::size_t place : places) chosen.push_back(values[first + place]);
  }
  return chosen;
}

}  // namespace hpr
