#pragma once

#include <bit>
#include <cstdint>

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

/// IEC 61966-2-1 without rounding, and back; clamped to [0, 1] before. NaN stays.
[[nodiscard]] float encode_srgb(float linear);
[[nodiscard]] float decode_srgb(float display);

}  // namespace hpr
