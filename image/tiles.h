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

#include "core/error.h"
#include "core/peer_memory.h"
#include "image/image.h"
#include "image/key.h"

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
  /// The pixels of all screens.
  [[nodiscard]] std::size_t pixels() const;
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

/// Asks the system to back large memory with huge pages: frames are touched all over, and other ranks copy from them.
void ask_for_huge_pages(void* memory, std::size_t bytes);

/// One value per pixel of a frame, tile after tile, row-major inside a tile, and a flag per tile that says whether
/// anything stands in it. Memory comes zeroed from the system and is touched only where tiles are active, so an empty
/// tile costs its flag. `Pixel{}` must be all zero bytes. Inactive tiles read as zeros.
template <typename Pixel>
class TileLayer {
  static_assert(std::is_trivially_copyable_v<Pixel>);

 public:
  TileLayer() = default;
  /// Makes an empty layer in memory of its own.
  explicit TileLayer(FrameLayout layout)
      : layout_(std::move(layout)), memory_(allocate(bytes_for(layout_) + kCacheLine)) {
    const auto past = reinterpret_cast<std::uintptr_t>(memory_.get()) % kCacheLine;
    place(memory_.get() + (kCacheLine - past) % kCacheLine);
  }
  /// Makes a layer in this rank's part of `peers`, which is zero or holds a layer of this layout: bytes_for(layout)
  /// bytes or more.
  TileLayer(FrameLayout layout, std::shared_ptr<PeerMemory> peers)
      : layout_(std::move(layout)), peers_(std::move(peers)) {
    HPR_CHECK(peers_->mine().size() >= bytes_for(layout_));
    place(peers_->mine().data());
  }
  /// The layer of another rank of this host, as it lies in the memory this one lives in.
  [[nodiscard]] TileLayer of_peer(int rank) const {
    HPR_CHECK(peers_ && !peers_->of(rank).empty());
    TileLayer peer;
    peer.layout_ = layout_;
    peer.peers_ = peers_;
    peer.depth_format_ = depth_format_;
    peer.place(peers_->of(rank).data());
    return peer;
  }
  /// Flags, then pixels at a multiple of a cache line.
  [[nodiscard]] static std::size_t bytes_for(const FrameLayout& layout) {
    return flag_bytes(layout) + layout.tiles() * kTilePixels * sizeof(Pixel);
  }

  [[nodiscard]] const FrameLayout& layout() const { return layout_; }
  /// Whose memory it lives in; null where that is its own.
  [[nodiscard]] PeerMemory* peers() const { return peers_.get(); }
  /// What depths of its keys look like: whoever draws into it quantizes them so, and messages leave out what that makes
  /// 0. The same on all ranks. Other pixels have no depth.
  [[nodiscard]] DepthFormat depth_format() const { return depth_format_; }
  void set_depth_format(DepthFormat format) { depth_format_ = format; }
  [[nodiscard]] std::size_t tiles() const { return layout_.tiles(); }
  [[nodiscard]] bool active(std::size_t tile) const { return active_[tile] != 0; }
  void set_active(std::size_t tile) { active_[tile] = 1; }
  [[nodiscard]] std::size_t active_tiles() const {
    return static_cast<std::size_t>(std::count(active_, active_ + tiles(), std::uint8_t{1}));
  }

  /// The 4096 pixels of a tile. Whoever writes to it also calls set_active.
  [[nodiscard]] std::span<Pixel> tile(std::size_t tile) { return {pixels_ + tile * kTilePixels, kTilePixels}; }
  [[nodiscard]] std::span<const Pixel> tile(std::size_t tile) const {
    return {pixels_ + tile * kTilePixels, kTilePixels};
  }
  /// The pixels of a run of tiles.
  [[nodiscard]] std::span<Pixel> run(TileRun run) {
    return {pixels_ + run.first * kTilePixels, run.count * kTilePixels};
  }
  [[nodiscard]] std::span<const Pixel> run(TileRun run) const {
    return {pixels_ + run.first * kTilePixels, run.count * kTilePixels};
  }

  [[nodiscard]] Pixel& at(std::size_t screen, int x, int y) { return pixels_[index(screen, x, y)]; }
  [[nodiscard]] const Pixel& at(std::size_t screen, int x, int y) const { return pixels_[index(screen, x, y)]; }

  /// Zeroes an inactive tile before something is added to it: a read would map the system's page of zeros first,
  /// and the first write after that stops all cores to unmap it.
  void touch(std::size_t tile) {
    if (!active(tile)) std::ranges::fill(this->tile(tile), Pixel{});
  }
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
    void operator()(std::byte* bytes) const { std::free(bytes); }
  };
  static constexpr std::size_t kCacheLine = 64;
  using Memory = std::unique_ptr<std::byte[], Free>;

  static Memory allocate(std::size_t bytes) {
    void* const memory = std::calloc(bytes, 1);
    if (memory == nullptr) throw std::bad_alloc();
    ask_for_huge_pages(memory, bytes);
    return Memory(static_cast<std::byte*>(memory));
  }

  static std::size_t flag_bytes(const FrameLayout& layout) {
    return (layout.tiles() + kCacheLine - 1) / kCacheLine * kCacheLine;
  }

  void place(std::byte* memory) {
    active_ = reinterpret_cast<std::uint8_t*>(memory);
    pixels_ = reinterpret_cast<Pixel*>(memory + flag_bytes(layout_));
  }

  [[nodiscard]] std::size_t index(std::size_t screen, int x, int y) const {
    const std::size_t inside =
        static_cast<std::size_t>(y % kTileSide) * kTileSide + static_cast<std::size_t>(x % kTileSide);
    return layout_.tile_at(screen, x, y) * kTilePixels + inside;
  }

  FrameLayout layout_;
  Memory memory_;                      ///< of its own, or
  std::shared_ptr<PeerMemory> peers_;  ///< shared
  std::uint8_t* active_ = nullptr;
  Pixel* pixels_ = nullptr;
  DepthFormat depth_format_ = DepthFormat::Float32;
};

/// 1 at the pixels somebody is to work at. Tiles that are not active: at all of them.
using PixelMask = TileLayer<std::uint8_t>;

/// A tile of a mask; empty where all pixels are meant.
[[nodiscard]] inline std::span<const std::uint8_t> mask_of(const PixelMask* mask, std::size_t tile) {
  return mask != nullptr && mask->active(tile) ? mask->tile(tile) : std::span<const std::uint8_t>();
}

/// Every tile of a frame.
[[nodiscard]] std::vector<std::size_t> all_tiles(const FrameLayout& layout);

/// Makes `tiles` of `to` what they are in `from`, a layer of the same layout.
template <typename Pixel>
void copy_tiles(const TileLayer<Pixel>& from, TileLayer<Pixel>& to, std::span<const std::size_t> tiles) {
  for (const std::size_t tile : tiles) {
    if (from.active(tile)) {
      std::ranges::copy(from.tile(tile), to.tile(tile).begin());
      to.set_active(tile);
    } else {
      to.clear(tile);
    }
  }
}

/// The pixels of one screen, row by row.
template <typename Pixel>
[[nodiscard]] Image<Pixel> to_image(const TileLayer<Pixel>& layer, std::size_t screen) {
  Image<Pixel> image(layer.layout().size(screen));
  const TileRun run = layer.layout().tiles_of(screen);
  for (std::size_t tile = run.first; tile < run.end(); ++tile) {
    if (!layer.active(tile)) continue;
    const Rect rect = layer.layout().place(tile).pixels;
    for (int y = rect.y0; y < rect.y1; ++y) {
      const auto from = layer.tile(tile).subspan(static_cast<std::size_t>(y - rect.y0) * kTileSide,
                                                 static_cast<std::size_t>(rect.width()));
      std::ranges::copy(from, image.row(y).begin() + rect.x0);
    }
  }
  return image;
}

}  // namespace hpr
