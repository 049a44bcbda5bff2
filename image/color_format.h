#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "image/color.h"
#include "image/half.h"

namespace hpr {

/// How radiance travels from the rank that lit it to the one that writes it: 12, 6 or 4 bytes a pixel.
enum class ColorFormat : std::uint8_t {
  Float32,  ///< exactly
  Float16,  ///< rounded to 11 bits of precision; past 65504 that
  Srgb8,    ///< as display colours: clamped to [0, 1], 256 levels
};
inline constexpr std::array<std::string_view, 3> kColorFormatNames{"32f", "16f", "8"};

[[nodiscard]] inline Rgb from_srgb(Rgba8 color) {
  return {srgb_to_linear(color.r), srgb_to_linear(color.g), srgb_to_linear(color.b)};
}

}  // namespace hpr
