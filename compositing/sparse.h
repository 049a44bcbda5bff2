#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "image/color.h"
#include "image/key.h"
#include "image/tiles.h"

/// Tiles that are partly drawn: which pixels are, and those alone.
namespace hpr {

/// One bit per pixel of a tile, the lowest first: is anything there?
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

/// About the share of a tile that is drawn, from every eighth run of 64 pixels: enough to share work by.
template <typename Pixel>
[[nodiscard]] double sampled_share(std::span<const Pixel> tile) {
  std::size_t drawn = 0;
  for (std::size_t first = 0; first < kTilePixels; first += 512) {
    for (const Pixel& pixel : tile.subspan(first, 64)) drawn += pixel != Pixel{} ? 1U : 0U;
  }
  return static_cast<double>(drawn) / (static_cast<double>(kTilePixels) / 8.0);
}

}  // namespace hpr
