#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "image/color.h"
#include "image/png_texts.h"

namespace hpr {

/// How light that may have any strength becomes what a display can show.
enum class Tone : std::uint8_t {
  Neutral,  ///< Khronos PBR Neutral: colours up to 0.8 as they are, brighter ones towards white
  Aces,     ///< filmic contrast, bright colours turn white: Academy Color Encoding System, Hill's fit
  Agx,      ///< low contrast, bright colours fade softly: AgX, Wrensch's fit
  Filmic,   ///< film with a soft toe and shoulder, channel by channel: Hable's curve
  None,     ///< clips at 1
};
inline constexpr std::array<std::string_view, 5> kToneNames{"neutral", "aces", "agx", "filmic", "none"};
[[nodiscard]] constexpr std::string_view name_of(Tone tone) {
  return kToneNames.at(static_cast<std::size_t>(tone));
}

/// Linear radiance to linear display light from 0 to 1. What is negative or no number counts as 0.
[[nodiscard]] Rgb tone_map(Tone tone, Rgb radiance);

/// How radiance becomes display colours.
struct DisplayTransform {
  double exposure_stops = 0.0;  ///< radiance is multiplied by 2 to the power of it first
  Tone tone = Tone::None;
  /// The name of what the pixels hold in place of radiance: display values, which are shown as they are.
  std::string_view shows = {};

  bool operator==(const DisplayTransform&) const = default;
};

/// The keywords by which a PNG says how its colours were made: a name of kToneNames, stops, and what it shows where
/// that is not light.
inline constexpr const char* kToneText = "hpr:tone";
inline constexpr const char* kExposureText = "hpr:exposure";
inline constexpr const char* kShowText = "hpr:show";
[[nodiscard]] PngTexts texts_of(const DisplayTransform& transform);

/// radiance[i] becomes display[i], with alpha 255.
void to_display(std::span<const Rgb> radiance, std::span<Rgba8> display, const DisplayTransform& transform);

/// What a display gets of a picture with alpha.
enum class AlphaUse : std::uint8_t {
  OverBlack,  ///< the picture in front of black, with alpha 255
  Straight,   ///< colours not multiplied by their alpha, and that, rounded to the nearest of 256 levels
};

/// Of a pixel that covers `alpha` (0 to 1) of what is behind it, and whose radiance is multiplied by it: the tone is
/// that of the surfaces, however little they cover.
[[nodiscard]] Rgba8 to_display(const Rgb& radiance, float alpha, const DisplayTransform& transform, AlphaUse use);
/// The radiance of what covers the pixel; black where nothing does.
[[nodiscard]] Rgb unassociated(const Rgb& radiance, float alpha);

}  // namespace hpr
