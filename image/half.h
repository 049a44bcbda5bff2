#pragma once

#include <bit>
#include <cstdint>

#include "image/color.h"

namespace hpr {

/// IEEE 754 binary16: 11 bits of precision from 6e-5 to 65504, and steps of 6e-8 below.
using Half = std::uint16_t;

/// To nearest, ties to even. What lies past 65504 becomes that, with its sign: light stays finite. NaN becomes 0.
[[nodiscard]] constexpr Half to_half(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  const std::uint32_t sign = bits >> 16U & 0x8000U;
  const std::uint32_t magnitude = bits & 0x7FFFFFFFU;
  if (magnitude > 0x7F800000U) return 0;
  if (magnitude >= 0x477FF000U) return static_cast<Half>(sign | 0x7BFFU);  // would round past the largest
  if (magnitude < 0x38800000U) {
    // Below 2^-14: adding 1/2 leaves multiples of 2^-24 in the lowest bits, rounded by the addition itself.
    const float shifted = std::bit_cast<float>(magnitude) + 0.5F;
    return static_cast<Half>(sign | (std::bit_cast<std::uint32_t>(shifted) - 0x3F000000U));
  }
  const std::uint32_t odd = magnitude >> 13U & 1U;
  return static_cast<Half>(sign | ((magnitude - 0x38000000U + 0xFFFU + odd) >> 13U));
}

/// Exactly.
[[nodiscard]] constexpr float from_half(Half half) {
  const std::uint32_t sign = std::uint32_t{half & 0x8000U} << 16U;
  const std::uint32_t magnitude = half & 0x7FFFU;
  if (magnitude >= 0x7C00U) return std::bit_cast<float>(sign | 0x7F800000U | magnitude << 13U);
  if (magnitude >= 0x400U) return std::bit_cast<float>(sign | ((magnitude << 13U) + 0x38000000U));
  const float small = static_cast<float>(magnitude) * 0x1p-24F;
  return std::bit_cast<float>(sign | std::bit_cast<std::uint32_t>(small));
}

/// Linear radiance in half the bytes.
struct RgbHalf {
  Half r = 0;
  Half g = 0;
  Half b = 0;

  bool operator==(const RgbHalf&) const = default;
};

[[nodiscard]] constexpr RgbHalf to_half(Rgb color) {
  return {to_half(color.r), to_half(color.g), to_half(color.b)};
}
[[nodiscard]] constexpr Rgb from_half(RgbHalf color) {
  return {from_half(color.r), from_half(color.g), from_half(color.b)};
}

}  // namespace hpr
