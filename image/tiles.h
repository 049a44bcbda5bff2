#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <span>
#include <type_traits>
#include <vector>

#include "core/check.h"
#include "image/image.h"

namespace hpr {

inline constexpr int kTileSide = 64;
/// Pixels of a tile. Tiles at the right and lower edge of a screen have as many; those past the edge stay empty.
inline constexpr std::size_t kTilePixels = std::size_t{kTileSide} * kTileSide;

/// Tiles [first, first + count) of a frame's list of tiles: what a rank owns after compositing is one such run.
struct TileRun {
  std::size_t first = 0;
  std::size_t count = 0;

  [[nodiscard]] std::size_t end() const { return first + count; }
  [[nodiscard]] bool contains(std::size_t tile) const { return tile >= first && tile < end(); }
  bool operator==(const TileRun&) const = default;
};

/// Where a tile lies.
struct TilePlace {
  std::size_t screen = 0;
  Rect pixels;  ///< of that screen, cut at its edge
};

/// A frame: its screens, cut into tiles of 64 x 64 pixels. The tiles of all screens form one list: screen after screen,
/// row after row from the top, left to right.
class FrameLayout {
 public:
  FrameLayout() = default;
  explicit FrameLayout(std::vector<Size> screens);

  [[nodiscard]] std::size_t screens() const { return sizes_.size(); }
  [[nodiscard]] Size size(std::size_t screen) const { return sizes_.at(screen); }
  /// Columns and rows of tiles.
  [[nodiscard]] Size tile_grid(std::size_t screen) const;
  /// All tiles of all screens.
  [[nodiscard]] std::size_t tiles() const { return first_tiles_.back(); }
  [[nodiscard]] TileRun tiles_of(std::size_t screen) const;
  [[nodiscard]] TilePlace place(std::size_t tile) const;
  /// The tile of `screen` that holds pixel (x, y).
  [[nodiscard]] std::size_t tile_at(std::size_t screen, int x, int y) const;

  bool operator==(const FrameLayout&) const = default;

 private:
  std::vector<Size> sizes_;
  std::vector<std::size_t> first_tiles_{0};  ///< per screen, and one past the last
};

/// One value per pixel of a frame, tile after tile, row-major inside a tile, and a flag per tile that says whether
/// anything stands in it. Memory comes zeroed from the system and is touched only where tiles are active, so an empty
/// tile costs its flag. `Pixel{}` must be all zero bytes. Inactive tiles read as zeros.
template <typename Pixel>
class TileLayer {
  static_assert(std::is_trivially_copyable_v<Pixel>);

 public:
  TileLayer() = default;
  explicit TileLayer(FrameLayout layout)
      : layout_(std::move(layout)), active_(layout_.tiles(), 0), pixels_(allocate(layout_.tiles())) {}

  [[nodiscard]] const FrameLayout& layout() const { return layout_; }
  [[nodiscard]] std::size_t tiles() const { return active_.size(); }
  [[nodiscard]] bool active(std::size_t tile) const { return active_[tile] != 0; }
  void set_active(std::size_t tile) { active_[tile] = 1; }
  [[nodiscard]] std::size_t active_tiles() const {
    return static_cast<std::size_t>(std::count(active_.begin(), active_.end(), std::uint8_t{1}));
  }

  /// The 4096 pixels of a tile. Whoever writes to it also calls set_active.
  [[nodiscard]] std::span<Pixel> tile(std::size_t tile) { return {pixels_.get() + tile * kTilePixels, kTilePixels}; }
  [[nodiscard]] std::span<const Pixel> tile(std::size_t tile) const {
    return {pixels_.get() + tile * kTilePixels, kTilePixels};
  }
  /// The pixels of a run of tiles.
  [[nodiscard]] std::span<Pixel> run(TileRun run) {
    return {pixels_.get() + run.first * kTilePixels, run.count * kTilePixels};
  }
  [[nodiscard]] std::span<const Pixel> run(TileRun run) const {
    return {pixels_.get() + run.first * kTilePixels, run.count * kTilePixels};
  }

  [[nodiscard]] Pixel& at(std::size_t screen, int x, int y) { return pixels_.get()[index(screen, x, y)]; }
  [[nodiscard]] const Pixel& at(std::size_t screen, int x, int y) const { return pixels_.get()[index(screen, x, y)]; }

  /// Makes a tile zero and inactive.
  void clear(std::size_t tile) {
    if (!active(tile)) return;
    std::ranges::fill(this->tile(tile), Pixel{});
    active_[tile] = 0;
  }
  void clear() {
    for (std::size_t i = 0; i < tiles(); ++i) clear(i);
  }

 private:
  struct Free {
    void operator()(Pixel* pixels) const { std::free(pixels); }
  };

  static std::unique_ptr<Pixel[], Free> allocate(std::size_t tiles) {
    if (tiles == 0) return nullptr;
    void* const memory = std::calloc(tiles, kTilePixels * sizeof(Pixel));
    if (memory == nullptr) throw std::bad_alloc();
    return std::unique_ptr<Pixel[], Free>(static_cast<Pixel*>(memory));
  }

  [[nodiscard]] std::size_t index(std::size_t screen, int x, int y) const {
    const std::size_t inside =
        static_cast<std::size_t>(y % kTileSide) * kTileSide + static_cast<std::size_t>(x % kTileSide);
    return layout_.tile_at(screen, x, y) * kTilePixels + inside;
  }

  FrameLayout layout_;
  std::vector<std::uint8_t> active_;
  std::unique_ptr<Pixel[], Free> pixels_;
};

/// The pixels of one screen, row by row.
template <typename Pixel>
[[nodiscard]] Image<Pixel> to_image(const TileLayer<Pixel>& layer, std::size_t screen) {
  Image<Pixel> image(layer.layout().size(screen));
  const TileRun run = layer.layout().tiles_of(screen);
  for (std::size_t tile = run.first; tile < run.end(); ++tile) {
    if (!layer.active(tile)) continue;
    const Rect place = layer.layout().place(tile).pixels;
    for (int y = place.y0; y < place.y1; ++y) {
      const auto from = layer.tile(tile).subspan(static_cast<std::size_t>(y - place.y0) * kTileSide,
                                                 static_cast<std::size_t>(place.width()));
      std::ranges::copy(from, image.row(y).begin() + place.x0);
    }
  }
  return image;
}

}  // namespace hpr
