#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "image/key.h"
#include "image/tiles.h"

/// Tiles that are partly drawn: which pixels are, and those alone.
namespace hpr {

/// One bit per pixel of a tile, the lowest first: is anything there?
using TileMask = std::array<std::uint64_t, kTilePixels / 64>;

/// Fills `mask`; returns how many pixels of the tile are drawn.
std::size_t find_drawn(std::span<const Key, kTilePixels> tile, TileMask& mask);

/// Writes the drawn pixels of a tile one after the other to `packed`, which has room for kTilePixels of them: the ones
/// past the last are scratch. Returns how many there are.
std::size_t pack_drawn(std::span<const Key, kTilePixels> tile, const TileMask& mask, Key* packed);

/// Merges packed pixels, as many as `mask` marks, into a tile: the nearer surface stays.
void merge_packed(std::span<Key, kTilePixels> tile, const TileMask& mask, std::span<const Key> packed);

}  // namespace hpr
