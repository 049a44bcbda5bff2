#include "image/tone.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "core/error.h"

namespace hpr {
namespace {

using Row = std::array<float, 3>;
using Matrix = std::array<Row, 3>;

Rgb multiply(const Matrix& matrix, const Rgb& color) {
  const auto dot = [&](const Row& row) { return row[0] * color.r + row[1] * color.g + row[2] * color.b; };
  return {dot(matrix[0]), dot(matrix[1]), dot(matrix[2])};
}

template <typename Curve>
Rgb each(const Rgb& color, const Curve& curve) {
  return {curve(color.r), curve(color.g), curve(color.b)};
}

/// Keeps what all curves can take: products of a few of these are finite. NaN becomes 0.
float usable(float value) {
  constexpr float kMax = 1e12F;
  return value > 0.0F ? std::min(value, kMax) : 0.0F;
}

/// Khronos Group, "PBR Neutral Tone Mapper" (2024): leaves the colours of lit surfaces alone but for a toe that takes
/// the 4 % away that dielectrics reflect.
Rgb neutral(Rgb color) {
  constexpr float kDielectric = 0.04F;
  constexpr float kStart = 0.8F - kDielectric;
  constexpr float kDesaturation = 0.15F;
  const float low = std::min({color.r, color.g, color.b});
  const float offset = low < 2.0F * kDielectric ? low - low * low / (4.0F * kDielectric) : kDielectric;
  color = each(color, [&](float value) { return value - offset; });
  const float peak = std::max({color.r, color.g, color.b});
  if (peak < kStart) return color;
  constexpr float kRoom = 1.0F - kStart;
  const float compressed = 1.0F - kRoom * kRoom / (peak + kRoom - kStart);
  const float scale = compressed / peak;
  const float white = 1.0F - 1.0F / (kDesaturation * (peak - compressed) + 1.0F);
  return each(color, [&](float value) { return value * scale * (1.0F - white) + compressed * white; });
}

/// Hill's fit of ACES' reference rendering and sRGB output transforms (in "BakingLab", 2016), lifted as renderers for
/// the web do: grey of 0.18 stays about where it is.
Rgb aces(const Rgb& color) {
  constexpr Matrix kIn{
      {{0.59719F, 0.35458F, 0.04823F}, {0.07600F, 0.90834F, 0.01566F}, {0.02840F, 0.13383F, 0.83777F}}};
  constexpr Matrix kOut{
      {{1.60475F, -0.53108F, -0.07367F}, {-0.10208F, 1.10813F, -0.00605F}, {-0.00327F, -0.07276F, 1.07602F}}};
  constexpr float kLift = 1.0F / 0.6F;
  const auto curve = [](float value) {
    return (value * (value + 0.0245786F) - 0.000090537F) / (value * (0.983729F * value + 0.4329510F) + 0.238081F);
  };
  return multiply(kOut, each(multiply(kIn, each(color, [](float value) { return value * kLift; })), curve));
}

/// Sobotka's AgX with Wrensch's polynomial for its contrast ("Minimal AgX Implementation", 2023), in Rec. 2020
/// primaries.
Rgb agx(const Rgb& color) {
  constexpr Matrix kToRec2020{{{0.6274F, 0.3293F, 0.0433F}, {0.0691F, 0.9195F, 0.0113F}, {0.0164F, 0.0880F, 0.8956F}}};
  constexpr Matrix kFromRec2020{
      {{1.6605F, -0.5876F, -0.0728F}, {-0.1246F, 1.1329F, -0.0083F}, {-0.0182F, -0.1006F, 1.1187F}}};
  constexpr Matrix kInset{{{0.856627153F, 0.0951212405F, 0.0482516061F},
                           {0.137318973F, 0.761241991F, 0.101439036F},
                           {0.111898212F, 0.0767994186F, 0.811302368F}}};
  constexpr Matrix kOutset{{{1.12710058F, -0.110606643F, -0.0164939387F},
                            {-0.141329763F, 1.15782370F, -0.0164939387F},
                            {-0.141329763F, -0.110606643F, 1.25193641F}}};
  constexpr float kLowStops = -12.47393F;
  constexpr float kHighStops = 4.026069F;
  const auto curve = [](float value) {
    const float stops = std::log2(std::max(value, 1e-10F));
    const float x = std::clamp((stops - kLowStops) / (kHighStops - kLowStops), 0.0F, 1.0F);
    const float x2 = x * x;
    const float x4 = x2 * x2;
    return 15.5F * x4 * x2 - 40.14F * x4 * x + 31.96F * x4 - 6.868F * x2 * x + 0.4298F * x2 + 0.1191F * x - 0.00232F;
  };
  const Rgb formed = multiply(kOutset, each(multiply(kInset, multiply(kToRec2020, color)), curve));
  return multiply(kFromRec2020, each(formed, [](float value) { return std::pow(std::max(value, 0.0F), 2.2F); }));
}

/// Hable, "Uncharted 2: HDR Lighting" (2010), with 11.2 as the light that becomes white.
Rgb filmic(const Rgb& color) {
  const auto curve = [](float x) {
    return (x * (0.15F * x + 0.05F) + 0.004F) / (x * (0.15F * x + 0.50F) + 0.06F) - 0.02F / 0.30F;
  };
  constexpr float kWhite = 11.2F;
  constexpr float kLift = 2.0F;
  const float scale = 1.0F / curve(kWhite);
  return each(color, [&](float value) { return curve(kLift * value) * scale; });
}

/// Display values from 0 to 1.
Rgba8 as_levels(const Rgb& values) {
  const auto level = [](float value) {
    return static_cast<std::uint8_t>(255.0F * std::min(usable(value), 1.0F) + 0.5F);
  };
  return {level(values.r), level(values.g), level(values.b), 255};
}

}  // namespace

Rgb tone_map(Tone tone, Rgb radiance) {
  const Rgb color = each(radiance, usable);
  const auto clipped = [](const Rgb& mapped) {
    return each(mapped, [](float value) { return std::clamp(value, 0.0F, 1.0F); });
  };
  switch (tone) {
    case Tone::Neutral:
      return clipped(neutral(color));
    case Tone::Aces:
      return clipped(aces(color));
    case Tone::Agx:
      return clipped(agx(color));
    case Tone::Filmic:
      return clipped(filmic(color));
    case Tone::None:
      return clipped(color);
  }
  HPR_CHECK(false);
}

PngTexts texts_of(const DisplayTransform& transform) {
  PngTexts texts{{kExposureText, fmt::format("{:.4g}", transform.exposure_stops)},
                 {kToneText, std::string(name_of(transform.tone))}};
  if (!transform.shows.empty()) texts.emplace(kShowText, transform.shows);
  return texts;
}

Rgb unassociated(const Rgb& radiance, float alpha) {
  if (!(alpha > 0.0F)) return {};
  return {radiance.r / alpha, radiance.g / alpha, radiance.b / alpha};
}

Rgba8 to_display(const Rgb& radiance, float alpha, const DisplayTransform& transform, AlphaUse use) {
  const auto gain = static_cast<float>(std::exp2(transform.exposure_stops));
  const Rgb color = unassociated(radiance, alpha);
  const Rgb shown = tone_map(transform.tone, {color.r * gain, color.g * gain, color.b * gain});
  const float covered = std::clamp(alpha, 0.0F, 1.0F);
  if (use == AlphaUse::OverBlack) return to_srgb({shown.r * covered, shown.g * covered, shown.b * covered});
  Rgba8 display = to_srgb(shown);
  display.a = static_cast<std::uint8_t>(std::lround(255.0F * covered));
  return display;
}

void to_display(std::span<const Rgb> radiance, std::span<Rgba8> display, const DisplayTransform& transform) {
  if (!transform.shows.empty()) {
    std::ranges::transform(radiance, display.begin(), as_levels);
    return;
  }
  const auto gain = static_cast<float>(std::exp2(transform.exposure_stops));
  const auto exposed = [gain](const Rgb& color) { return Rgb{color.r * gain, color.g * gain, color.b * gain}; };
  if (transform.tone == Tone::None) {
    std::ranges::transform(radiance, display.begin(), [&](const Rgb& color) { return to_srgb(exposed(color)); });
  } else {
    std::ranges::transform(radiance, display.begin(),
                           [&](const Rgb& color) { return to_srgb(tone_map(transform.tone, exposed(color))); });
  }
}

}  // namespace hpr
