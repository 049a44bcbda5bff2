#include "scene/environment.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string_view>

#include "core/error.h"
#include "core/text.h"

namespace hpr {
namespace {

constexpr float kBrightest = 1e12F;  ///< radiance a user may ask for
constexpr float kMaxHalf = 65504.0F;

/// Three numbers with commas between; none for anything else.
std::optional<std::array<float, 3>> three_numbers(std::string_view text) {
  std::array<float, 3> numbers{};
  const char* at = text.data();
  const char* const end = at + text.size();
  for (std::size_t i = 0; i < 3; ++i) {
    if (i > 0 && (at == end || *at++ != ',')) return std::nullopt;
    const auto [rest, error] = std::from_chars(at, end, numbers[i]);
    if (error != std::errc()) return std::nullopt;
    at = rest;
  }
  return at == end ? std::optional(numbers) : std::nullopt;
}

float cleaned(float value) {
  if (!(value > 0.0F)) return 0.0F;
  return std::isfinite(value) ? value : kMaxHalf;
}

/// Where the channels R, G, B of a picture stand; grey pictures have the same one three times.
std::array<std::size_t, 3> color_channels(const FloatImage& picture, const std::string& name) {
  const auto find = [&](std::string_view channel) {
    return static_cast<std::size_t>(std::ranges::find(picture.channels, channel) - picture.channels.begin());
  };
  const std::size_t none = picture.channels.size();
  const std::array<std::size_t, 3> rgb{find("R"), find("G"), find("B")};
  if (std::ranges::count(rgb, none) == 0) return rgb;
  const std::size_t grey = find("Y");
  if (grey < none || none <= 2) return {grey % none, grey % none, grey % none};
  throw Error(ExitCode::BadInput, fmt::format("{}: the picture has no channels R, G and B", name),
              "convert it to a picture with red, green and blue");
}

}  // namespace

Environment load_environment(const std::string& text, const ImageLimits& limits) {
  if (const auto numbers = three_numbers(text)) {
    for (const float radiance : *numbers) {
      if (radiance >= 0.0F && radiance <= kBrightest) continue;
      throw Error(ExitCode::Usage, fmt::format("an environment of radiance {}", printable(text)),
                  "give three numbers from 0 to 1e12");
    }
    return {Image<Rgb>({1, 1}, {(*numbers)[0], (*numbers)[1], (*numbers)[2]})};
  }
  std::string extension = std::filesystem::path(text).extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  if (extension != ".hdr" && extension != ".exr" && extension != ".png" && extension != ".jpg" &&
      extension != ".jpeg") {
    throw Error(ExitCode::Usage, fmt::format("'{}' is no environment", printable(text)),
                "name a .hdr, .exr, .png or .jpg picture, or give a radiance as R,G,B");
  }
  return environment_of(read_image(text, limits), printable(text));
}

Environment environment_of(const FloatImage& picture, const std::string& name) {
  const std::array<std::size_t, 3> rgb = color_channels(picture, name);
  Environment environment{Image<Rgb>(picture.size)};
  const auto value = [&](std::size_t pixel, std::size_t channel) {
    const float stored = picture.values[pixel * picture.channels.size() + rgb[channel]];
    if (!std::isfinite(stored) && environment.not_finite++ == 0) environment.first_not_finite = pixel;
    if (picture.linear) return cleaned(stored);
    return srgb_to_linear(static_cast<std::uint8_t>(std::lround(255.0F * std::clamp(stored, 0.0F, 1.0F))));
  };
  const std::span<Rgb> pixels = environment.image.pixels();
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = {value(i, 0), value(i, 1), value(i, 2)};
  return environment;
}

}  // namespace hpr
