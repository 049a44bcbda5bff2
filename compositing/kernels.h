#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "image/color.h"
#include "image/key.h"
#include "image/tiles.h"

/// Loops over runs of pixels: merging, blending, packing of those that are drawn, keys as they are sent. Vectorised by
/// Highway where that pays.
namespace hpr {

/// into[i] = max(into[i], from[i]): the nearer surface of two layers, the lower id on equal depths. Both of one length,
/// either the same memory or apart; any alignment of a key. Runs at memory speed, by the widest vectors this machine
/// has, chosen at the first call; every instruction set gives the same bits.
void merge_keys(std::span<Key> into, std::span<const Key> from);

/// into[i] = front[i] over back[i], channel by channel front + (1 - alpha of front) back: Porter and Duff, "Compositing
/// Digital Images", 1984. All of one length; `into` may be `front` or `back`, else all lie apart. By the widest vectors
/// this machine has; every instruction set gives the same bits.
///
/// Associative but not commutative, and that only up to rounding: docs/numerics.md has the bounds. A transparent pixel
/// changes nothing on either side, not a bit, so that leaving transparent pixels out is exact.
///
/// 8 bits: front + (x + 128 + ((x + 128) >> 8) >> 8) with x = (255 - alpha of front) back, which is x / 255 rounded to
/// nearest (no x is a tie); sums past 255, which premultiplied layers never reach, stay at 255.
void composite_over(std::span<const Rgba8Premultiplied> front, std::span<const Rgba8Premultiplied> back,
                    std::span<Rgba8Premultiplied> into);

/// Floats: three roundings, of 1 - alpha, of the product and of the sum, and no fused ones. Light past 1 is kept.
void composite_over(std::span<const RgbaPremultiplied> front, std::span<const RgbaPremultiplied> back,
                    std::span<RgbaPremultiplied> into);

/// How far blending `layers` premultiplied layers may end up from the exact result in any channel, however neighbours
/// are grouped: in levels of 8 bits, or for colours that lie in [0, 1] (for brighter ones times the least power of two
/// that no channel over alpha exceeds). Two groupings may differ by twice that. docs/numerics.md has the proof.
template <typename Pixel>
[[nodiscard]] constexpr double over_error_bound(int layers) {
  const double merges = layers - 1;
  if constexpr (std::is_same_v<Pixel, Rgba8Premultiplied>) {
    return merges;
  } else {
    constexpr double kThreeRoundings = 3 * 0x1p-24 / (1 - 3 * 0x1p-24);
    constexpr double kUnderflow = 0x1p-149;
    return merges * (2 * kThreeRoundings + kUnderflow);
  }
}

/// Writes quantized `keys` as they are sent to `bytes`, which has room for them: sent_bytes(format) bytes each, the
/// surface before the depth, the lowest byte first.
void narrow_keys(std::span<const Key> keys, DepthFormat format, std::byte* bytes);

/// Reads as many keys as `keys` has room for, from bytes that narrow_keys wrote.
void widen_keys(const std::byte* bytes, DepthFormat format, std::span<Key> keys);

/// One bit per pixel of a tile, the lowest first: whether the pixel is drawn, that is, has a bit that is not zero.
using TileMask = std::array<std::uint64_t, kTilePixels / 64>;

/// Fills `mask`; returns how many pixels of the tile are drawn: have a bit that is not zero.
std::size_t find_drawn(std::span<const Key, kTilePixels> tile, TileMask& mask);
std::size_t find_drawn(std::span<const Rgba8Premultiplied, kTilePixels> tile, TileMask& mask);
std::size_t find_drawn(std::span<const RgbaPremultiplied, kTilePixels> tile, TileMask& mask);

/// Writes the drawn pixels of a tile one after the other to `packed`, which has room for kTilePixels of them: the ones
/// past the last are scratch. Returns how many there are.
std::size_t pack_drawn(std::span<const Key, kTilePixels> tile, const TileMask& mask, Key* packed);
std::size_t pack_drawn(std::span<const Rgba8Premultiplied, kTilePixels> tile, const TileMask& mask,
                       Rgba8Premultiplied* packed);
std::size_t pack_drawn(std::span<const RgbaPremultiplied, kTilePixels> tile, const TileMask& mask,
                       RgbaPremultiplied* packed);

/// Merges packed pixels, as many as `mask` marks, into a tile: the nearer surface stays.
void merge_packed(std::span<Key, kTilePixels> tile, const TileMask& mask, std::span<const Key> packed);

/// Writes packed pixels, as many as `mask` marks, to where they were; the other pixels of the tile stay.
void unpack_drawn(std::span<const Rgba8Premultiplied> packed, const TileMask& mask,
                  std::span<Rgba8Premultiplied, kTilePixels> tile);
void unpack_drawn(std::span<const RgbaPremultiplied> packed, const TileMask& mask,
                  std::span<RgbaPremultiplied, kTilePixels> tile);

/// About the fraction of a tile that is drawn, from every eighth run of 64 pixels: enough to share work by.
template <typename Pixel>
[[nodiscard]] double sampled_fraction(std::span<const Pixel> tile) {
  std::size_t drawn = 0;
  for (std::size_t first = 0; first < kTilePixels; first += 512) {
    for (const Pixel& pixel : tile.subspan(first, 64)) drawn += pixel != Pixel{} ? 1U : 0U;
  }
  return static_cast<double>(drawn) / (static_cast<double>(kTilePixels) / 8.0);
}

}  // namespace hpr
