#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <string_view>

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

/// How many bits of depth a key keeps: one with fewer takes fewer bytes in a message.
///
/// A reversed-Z depth is a float between 0 and 1, so its two highest bits are 0 and its bits order as it does. Of the
/// other thirty the highest 24 or 16 stay, rounded to nearest: the exponent is whole, so the step is 2^-17 or 2^-9 of
/// the depth, and of the distance, wherever a surface lies. Rounding is monotone: a nearer depth stays nearer or
/// becomes equal, and among equal depths the lower surface id wins.
enum class DepthFormat : std::uint8_t { Float32, Bits24, Bits16 };
inline constexpr std::array<std::string_view, 3> kDepthFormatNames{"32f", "24", "16"};

/// How many of the 32 bits of a depth are dropped.
[[nodiscard]] constexpr unsigned lost_bits(DepthFormat format) {
  constexpr std::array<unsigned, 3> kLost{0, 6, 14};
  return kLost.at(static_cast<std::size_t>(format));
}
/// The bytes of a key in a message.
[[nodiscard]] constexpr std::size_t sent_bytes(DepthFormat format) {
  constexpr std::array<std::size_t, 3> kBytes{8, 7, 6};
  return kBytes.at(static_cast<std::size_t>(format));
}

/// `depth`: reversed-Z, from 0 to 1.
[[nodiscard]] constexpr float quantized_depth(float depth, DepthFormat format) {
  const unsigned lost = lost_bits(format);
  const auto half = (std::uint32_t{1} << lost) >> 1U;
  return std::bit_cast<float>((std::bit_cast<std::uint32_t>(depth) + half) >> lost << lost);
}
[[nodiscard]] constexpr Key quantized_key(Key key, DepthFormat format) {
  const auto depth = std::bit_cast<std::uint32_t>(quantized_depth(key_depth(key), format));
  return Key{depth} << 32U | static_cast<std::uint32_t>(key);
}

/// A quantized key in the lowest sent_bytes of a word, and back.
[[nodiscard]] constexpr std::uint64_t narrow_key(Key key, DepthFormat format) {
  return key >> 32U >> lost_bits(format) << 32U | static_cast<std::uint32_t>(key);
}
[[nodiscard]] constexpr Key wide_key(std::uint64_t narrow, DepthFormat format) {
  return narrow >> 32U << (32U + lost_bits(format)) | static_cast<std::uint32_t>(narrow);
}

}  // namespace hpr
