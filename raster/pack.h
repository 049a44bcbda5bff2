#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "image/key.h"
#include "image/tiles.h"

namespace hpr {

/// Merges (maximum) the keys of a rectangle into the tiles of `screen` and marks those tiles active where anything was
/// drawn. `depths` and `words` (the keys' halves) are [height][width] of `pixels`, the last row first, as GL reads
/// them; 0 in both where nothing was drawn.
void pack_keys(std::span<const float> depths, std::span<const std::uint32_t> words, const Rect& pixels,
               std::size_t screen, TileLayer<Key>& layer, int threads);

}  // namespace hpr
