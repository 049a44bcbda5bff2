#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <string_view>

namespace hpr {

/// Linear radiance in the scene's units (sRGB primaries).
struct Rgb {
  float r = 0.0F;
  float g = 0.0F;
  float b = 0.0F;

  bool operator==(const Rgb&) const = default;
};

/// Display colour: sRGB transfer function, straight alpha, bytes in this order in memory.
struct Rgba8 {
  std::uint8_t r = 0;
  std::uint8_t g = 0;
  std::uint8_t b = 0;
  std::uint8_t a = 0;

  bool operator==(const Rgba8&) const = default;
};

/// The word whose bytes in memory are r, g, b, a (little-endian machines, the only ones HPR runs on).
[[nodiscard]] constexpr std::uint32_t to_word(Rgba8 color) {
  return std::bit_cast<std::uint32_t>(color);
}
[[nodiscard]] constexpr Rgba8 from_word(std::uint32_t word) {
  return std::bit_cast<Rgba8>(word);
}

/// IEC 61966-2-1, clamped to [0, 1], rounded to the nearest of 256 levels; NaN becomes 0. Alpha is 255.
[[nodiscard]] Rgba8 to_srgb(Rgb linear);

/// The linear value of an 8-bit sRGB level.
[[nodiscard]] float srgb_to_linear(std::uint8_t level);
/// The linear colour of a display colour; its alpha is ignored.
[[nodiscard]] inline Rgb from_srgb(Rgba8 color) {
  return {srgb_to_linear(color.r), srgb_to_linear(color.g), srgb_to_linear(color.b)};
}

/// IEC 61966-2-1 without rounding, and back; clamped to [0, 1] before. NaN stays.
[[nodiscard]] float encode_srgb(float linear);
[[nodiscard]] float decode_srgb(float display);

/// The bits of an IEEE 754 binary16: 11 bits of precision from 6e-5 to 65504, and steps of 6e-8 below.
using HalfBits = std::uint16_t;

/// Rounds to the nearest half float, ties to even. What lies past 65504 becomes 65504, with its sign: light stays
/// finite. NaN becomes 0.
[[nodiscard]] constexpr HalfBits to_half(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  const std::uint32_t sign = bits >> 16U & 0x8000U;
  const std::uint32_t magnitude = bits & 0x7FFFFFFFU;
  if (magnitude > 0x7F800000U) return 0;
  if (magnitude >= 0x477FF000U) return static_cast<HalfBits>(sign | 0x7BFFU);  // would round past the largest
  if (magnitude < 0x38800000U) {
    // Below 2^-14: adding 1/2 leaves multiples of 2^-24 in the lowest bits, rounded by the addition itself.
    const float shifted = std::bit_cast<float>(magnitude) + 0.5F;
    return static_cast<HalfBits>(sign | (std::bit_cast<std::uint32_t>(shifted) - 0x3F000000U));
  }
  const std::uint32_t odd = magnitude >> 13U & 1U;
  return static_cast<HalfBits>(sign | ((magnitude - 0x38000000U + 0xFFFU + odd) >> 13U));
}

/// Exactly.
[[nodiscard]] constexpr float from_half(HalfBits half) {
  const std::uint32_t sign = std::uint32_t{half & 0x8000U} << 16U;
  const std::uint32_t magnitude = half & 0x7FFFU;
  if (magnitude >= 0x7C00U) return std::bit_cast<float>(sign | 0x7F800000U | magnitude << 13U);
  if (magnitude >= 0x400U) return std::bit_cast<float>(sign | ((magnitude << 13U) + 0x38000000U));
  const float small = static_cast<float>(magnitude) * 0x1p-24F;
  return std::bit_cast<float>(sign | std::bit_cast<std::uint32_t>(small));
}

/// Linear radiance in half the bytes.
struct RgbHalf {
  HalfBits r = 0;
  HalfBits g = 0;
  HalfBits b = 0;

  bool operator==(const RgbHalf&) const = default;
};

[[nodiscard]] constexpr RgbHalf to_half(Rgb color) {
  return {to_half(color.r), to_half(color.g), to_half(color.b)};
}
[[nodiscard]] constexpr Rgb from_half(RgbHalf color) {
  return {from_half(color.r), from_half(color.g), from_half(color.b)};
}

/// How radiance travels from the rank that lit it to the one that writes it: 12, 6 or 4 bytes a pixel.
enum class ColorFormat : std::uint8_t {
  Float32,  ///< exactly
  Float16,  ///< rounded to 11 bits of precision; past 65504 that
  Srgb8,    ///< as display colours: clamped to [0, 1], 256 levels
};
inline constexpr std::array<std::string_view, 3> kColorFormatNames{"32f", "16f", "8"};

/// A translucent pixel: a colour multiplied by its alpha, which is how much it hides of what lies behind. No channel
/// exceeds alpha, except for light that a pixel adds without hiding anything. All zero bits is a transparent pixel.
///
/// Bytes in this order in memory, 255 is 1. Whoever makes the pixel decides whether its colour is linear: `over` blends
/// the stored values.
struct Rgba8Premultiplied {
  std::uint8_t r = 0;
  std::uint8_t g = 0;
  std::uint8_t b = 0;
  std::uint8_t a = 0;

  bool operator==(const Rgba8Premultiplied&) const = default;
};

/// A translucent pixel of linear radiance: see Rgba8Premultiplied for the meaning of its alpha.
struct RgbaPremultiplied {
  float r = 0.0F;
  float g = 0.0F;
  float b = 0.0F;
  float a = 0.0F;

  bool operator==(const RgbaPremultiplied&) const = default;
};

}  // namespace hpr
