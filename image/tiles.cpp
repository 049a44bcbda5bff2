#include "image/tiles.h"

#include <sys/mman.h>

#include <numeric>
#include <utility>

namespace hpr {
namespace {

constexpr std::size_t kHugePage = std::size_t{2} << 20U;

int tiles_along(int pixels) {
  return (pixels + kTileSide - 1) / kTileSide;
}

}  // namespace

void ask_for_huge_pages(void* memory, std::size_t bytes) {
  const auto start = reinterpret_cast<std::uintptr_t>(memory);
  const std::uintptr_t first = (start + kHugePage - 1) / kHugePage * kHugePage;
  const std::uintptr_t end = (start + bytes) / kHugePage * kHugePage;
  // Where the system has none left, or never gives any, small ones do.
  if (end > first) (void)::madvise(static_cast<std::byte*>(memory) + (first - start), end - first, MADV_HUGEPAGE);
}

std::vector<std::size_t> all_tiles(const FrameLayout& layout) {
  std::vector<std::size_t> tiles(layout.tiles());
  std::iota(tiles.begin(), tiles.end(), std::size_t{0});
  return tiles;
}

FrameLayout::FrameLayout(std::vector<Size> screens) : sizes_(std::move(screens)) {
  for (const Size& size : sizes_) {
    HPR_CHECK(size.width > 0 && size.height > 0);
    const Size grid{tiles_along(size.width), tiles_along(size.height)};
    first_tiles_.push_back(first_tiles_.back() + grid.area());
  }
}

std::size_t FrameLayout::pixels() const {
  return std::accumulate(sizes_.begin(), sizes_.end(), std::size_t{0},
                         [](std::size_t sum, const Size& size) { return sum + size.area(); });
}

Size FrameLayout::tile_grid(std::size_t screen) const {
  return {tiles_along(size(screen).width), tiles_along(size(screen).height)};
}

TileRun FrameLayout::tiles_of(std::size_t screen) const {
  return {first_tiles_.at(screen), first_tiles_.at(screen + 1) - first_tiles_.at(screen)};
}

TilePlace FrameLayout::place(std::size_t tile) const {
  HPR_CHECK(tile < tiles());
  const auto after = std::upper_bound(first_tiles_.begin(), first_tiles_.end(), tile);
  const auto screen = static_cast<std::size_t>(after - first_tiles_.begin()) - 1;
  const auto columns = static_cast<std::size_t>(tile_grid(screen).width);
  const std::size_t inside = tile - first_tiles_[screen];
  const int x0 = static_cast<int>(inside % columns) * kTileSide;
  const int y0 = static_cast<int>(inside / columns) * kTileSide;
  const Size edge = sizes_[screen];
  return {screen, {x0, y0, std::min(x0 + kTileSide, edge.width), std::min(y0 + kTileSide, edge.height)}};
}

std::size_t FrameLayout::tile_at(std::size_t screen, int x, int y) const {
  const auto columns = static_cast<std::size_t>(tiles_along(sizes_[screen].width));
  return first_tiles_[screen] + static_cast<std::size_t>(y / kTileSide) * columns +
         static_cast<std::size_t>(x / kTileSide);
}

}  // namespace hpr
