#pragma once

#include <bit>
#include <cstdint>

namespace hpr {

/// What a rank knows of one pixel: the bits of its reversed-Z depth above the complement of its surface id. Positive
/// floats order like their bits, so the nearer surface has the larger key, and of two at one depth the lower id has:
/// depth compositing is the maximum of keys, associative, commutative, idempotent and exact.
using Key = std::uint64_t;

/// A pixel where nothing was drawn.
inline constexpr Key kNoKey = 0;

/// `depth`: reversed-Z, 1 at the near plane, 0 at infinity, never negative or NaN. `surface` < 2^32 - 1.
[[nodiscard]] constexpr Key make_key(float depth, std::uint32_t surface) {
  return Key{std::bit_cast<std::uint32_t>(depth)} << 32U | static_cast<std::uint32_t>(~surface);
}
/// A key whose low word is a colour instead (`--shading local`, synthetic layers).
[[nodiscard]] constexpr Key make_color_key(float depth, std::uint32_t rgba) {
  return Key{std::bit_cast<std::uint32_t>(depth)} << 32U | rgba;
}
[[nodiscard]] constexpr float key_depth(Key key) {
  return std::bit_cast<float>(static_cast<std::uint32_t>(key >> 32U));
}
[[nodiscard]] constexpr std::uint32_t key_surface(Key key) {
  return ~static_cast<std::uint32_t>(key);
}
[[nodiscard]] constexpr std::uint32_t key_rgba(Key key) {
  return static_cast<std::uint32_t>(key);
}

}  // namespace hpr
