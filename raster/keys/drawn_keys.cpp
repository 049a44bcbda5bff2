#include "raster/keys/drawn_keys.h"

#include <algorithm>
#include <bit>

#include "core/error.h"
#include "core/parallel.h"

namespace hpr {
namespace {

/// A rectangle of GL's rows.
struct Rows {
  const float* depths;
  const std::uint32_t* words;
  Rect pixels;

  /// The index of pixel (x, y) of the screen.
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(pixels.y1 - 1 - y) * static_cast<std::size_t>(pixels.width()) +
           static_cast<std::size_t>(x - pixels.x0);
  }
};

bool any_drawn(const Rows& rows, const Rect& rect) {
  const auto width = static_cast<std::size_t>(rect.width());
  for (int y = rect.y0; y < rect.y1; ++y) {
    const float* const depth = rows.depths + rows.index(rect.x0, y);
    std::uint32_t bits = 0;
    for (std::size_t x = 0; x < width; ++x) bits |= std::bit_cast<std::uint32_t>(depth[x]);
    if (bits != 0) return true;
  }
  return false;
}

Key joined(float depth, std::uint32_t word) {
  return Key{std::bit_cast<std::uint32_t>(depth)} << 32U | word;
}

/// Into a tile that holds nothing yet: no comparison, and its memory is not read before it is written.
void store_row(const float* depths, const std::uint32_t* words, std::size_t count, Key* keys) {
  for (std::size_t x = 0; x < count; ++x) keys[x] = joined(depths[x], words[x]);
}

void merge_row(const float* depths, const std::uint32_t* words, std::size_t count, Key* keys) {
  for (std::size_t x = 0; x < count; ++x) keys[x] = std::max(keys[x], joined(depths[x], words[x]));
}

/// Where a tile of a layer is, and what of it was drawn.
struct PackedTile {
  std::size_t in_layer;
  std::size_t in_grid;
  Rect pixels;  ///< of the tile, inside the rectangle that was drawn
};

void pack_tile(const KeyHalves& halves, const Rect& pixels, const PackedTile& tile, TileLayer<Key>& layer) {
  const Rows rows{halves.depths.data(), halves.words.data(), pixels};
  const Rect& rect = tile.pixels;
  if (!any_drawn(rows, rect)) return;
  Key* const keys = layer.tile(tile.in_layer).data();
  const auto write_row = layer.active(tile.in_layer) ? merge_row : store_row;
  for (int y = rect.y0; y < rect.y1; ++y) {
    const std::size_t from = rows.index(rect.x0, y);
    write_row(rows.depths + from, rows.words + from, static_cast<std::size_t>(rect.width()),
              keys + std::ptrdiff_t{kTileSide} * (y % kTileSide) + rect.x0 % kTileSide);
  }
  layer.set_active(tile.in_layer);
}

void pack_tile(const KeyTiles& tiles, const Rect& /*pixels*/, const PackedTile& tile, TileLayer<Key>& layer) {
  if (tiles.drawn[tile.in_grid] == 0) return;
  const std::span<const Key> from = tiles.keys.subspan(tile.in_grid * kTilePixels, kTilePixels);
  const std::span<Key> to = layer.tile(tile.in_layer);
  if (layer.active(tile.in_layer)) {
    for (std::size_t i = 0; i < kTilePixels; ++i) to[i] = std::max(to[i], from[i]);
  } else {
    std::ranges::copy(from, to.begin());
  }
  layer.set_active(tile.in_layer);
}

bool holds(const DrawnKeys& drawn, const Rect& pixels, const TileGrid& grid) {
  if (const auto* const halves = std::get_if<KeyHalves>(&drawn)) {
    return halves->depths.size() >= pixels.area() && halves->words.size() >= pixels.area();
  }
  const auto& tiles = std::get<KeyTiles>(drawn);
  return tiles.keys.size() >= grid.tiles() * kTilePixels && tiles.drawn.size() >= grid.tiles();
}

}  // namespace

TileGrid tiles_around(const Rect& pixels) {
  const int first_column = pixels.x0 / kTileSide;
  const int first_row = pixels.y0 / kTileSide;
  return {first_column, first_row, (pixels.x1 - 1) / kTileSide - first_column + 1,
          (pixels.y1 - 1) / kTileSide - first_row + 1};
}

void pack_keys(std::span<const DrawnKeys> drawn, const Rect& pixels, std::size_t screen, TileLayer<Key>& layer,
               int threads) {
  if (pixels.empty()) return;
  const TileGrid grid = tiles_around(pixels);
  for (const DrawnKeys& each : drawn) HPR_CHECK(holds(each, pixels, grid));
  parallel_for(threads, grid.tiles(), [&](std::size_t i) {
    const int x0 = (grid.first_column + static_cast<int>(i) % grid.columns) * kTileSide;
    const int y0 = (grid.first_row + static_cast<int>(i) / grid.columns) * kTileSide;
    const PackedTile tile{layer.layout().tile_at(screen, x0, y0), i,
                          intersection(pixels, {x0, y0, x0 + kTileSide, y0 + kTileSide})};
    for (const DrawnKeys& each : drawn) {
      std::visit([&](const auto& keys) { pack_tile(keys, pixels, tile, layer); }, each);
    }
  });
}

}  // namespace hpr
