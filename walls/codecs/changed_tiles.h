#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "image/color.h"
#include "image/image.h"

namespace hpr {

/// Squares of 64 pixels a side, row by row; those at the right and lower border may be smaller.
constexpr int kDeltaSide = 64;

[[nodiscard]] std::size_t delta_tile_count(Size picture);

/// Indices of the tiles of `now` with a pixel outside `error` of `before` (all_within); equal sizes.
[[nodiscard]] std::vector<std::size_t> changed_tiles(const Image<Rgba8>& before, const Image<Rgba8>& now, int error);

/// The size of a picture that holds so many tiles of a picture side by side.
[[nodiscard]] Size packed_size(Size picture, std::size_t tiles);

/// These tiles side by side; what they do not fill is 0.
[[nodiscard]] Image<Rgba8> pack_tiles(const Image<Rgba8>& picture, std::span<const std::size_t> tiles);
/// Back into their places.
void unpack_tiles(const Image<Rgba8>& packed, std::span<const std::size_t> tiles, Image<Rgba8>& picture);

/// One bit per tile, set for `tiles`, and back. Throws Error (BadInput) for bits past the last tile; `bytes` has the
/// length of what append_bits appended.
[[nodiscard]] std::size_t tile_bits_size(Size picture);
void append_bits(std::span<const std::size_t> tiles, Size picture, std::vector<std::byte>& into);
[[nodiscard]] std::vector<std::size_t> read_bits(std::span<const std::byte> bytes, Size picture);

}  // namespace hpr
