#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <variant>

#include "image/image.h"
#include "image/key.h"
#include "image/tiles.h"

namespace hpr {

/// A rectangle of tiles of a screen, counted as its tile_grid() does.
struct TileGrid {
  int first_column = 0;
  int first_row = 0;
  int columns = 0;
  int rows = 0;

  [[nodiscard]] std::size_t tiles() const { return static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns); }
};

/// The tiles that have pixels of a rectangle of a screen, which is not empty.
[[nodiscard]] TileGrid tiles_around(const Rect& pixels);

/// The halves of a rectangle's keys: [height][width], the last row first, as GL reads them; 0 in both where nothing was
/// drawn.
struct KeyHalves {
  std::span<const float> depths;
  std::span<const std::uint32_t> words;
};

/// A rectangle's keys as layers hold them: [tile of tiles_around()][64 * 64], row after row, row 0 at the top; 0
/// outside the rectangle.
struct KeyTiles {
  std::span<const Key> keys;
  std::span<const std::uint32_t> drawn;  ///< [tile]: 0 where nothing was drawn
};

using DrawnKeys = std::variant<KeyHalves, KeyTiles>;

/// Merges (maximum) the keys of the rectangle `pixels`, once or several times drawn, into the tiles of `screen`, and
/// marks those tiles active where anything was drawn.
void pack_keys(std::span<const DrawnKeys> drawn, const Rect& pixels, std::size_t screen, TileLayer<Key>& layer,
               int threads);

}  // namespace hpr
