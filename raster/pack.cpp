#include "raster/pack.h"

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

  /// Of pixel (x, y) of the screen.
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

}  // namespace

void pack_keys(std::span<const float> depths, std::span<const std::uint32_t> words, const Rect& pixels,
               std::size_t screen, TileLayer<Key>& layer, int threads) {
  if (pixels.empty()) return;
  HPR_CHECK(depths.size() >= pixels.area() && words.size() >= pixels.area());
  const Rows rows{depths.data(), words.data(), pixels};
  const int first_column = pixels.x0 / kTileSide;
  const int first_row = pixels.y0 / kTileSide;
  const int last_column = (pixels.x1 - 1) / kTileSide;
  const int tile_rows = (pixels.y1 - 1) / kTileSide - first_row + 1;

  parallel_for(threads, static_cast<std::size_t>(tile_rows), [&](std::size_t row) {
    for (int column = first_column; column <= last_column; ++column) {
      const int x0 = column * kTileSide;
      const int y0 = (first_row + static_cast<int>(row)) * kTileSide;
      const Rect rect = intersection(pixels, {x0, y0, x0 + kTileSide, y0 + kTileSide});
      if (!any_drawn(rows, rect)) continue;
      const std::size_t tile = layer.layout().tile_at(screen, x0, y0);
      Key* const keys = layer.tile(tile).data();
      const auto write_row = layer.active(tile) ? merge_row : store_row;
      for (int y = rect.y0; y < rect.y1; ++y) {
        const std::size_t from = rows.index(rect.x0, y);
        write_row(rows.depths + from, rows.words + from, static_cast<std::size_t>(rect.width()),
                  keys + std::ptrdiff_t{kTileSide} * (y - y0) + (rect.x0 - x0));
      }
      layer.set_active(tile);
    }
  });
}

}  // namespace hpr
