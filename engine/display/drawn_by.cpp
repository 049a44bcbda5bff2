#include "engine/display/drawn_by.h"

#include <algorithm>
#include <iterator>

#include "core/error.h"

namespace hpr {

DrawnBy::DrawnBy(std::span<const Assignment> assignments, const FrameLayout& layout) : group_of_tile_(layout.tiles()) {
  for (std::size_t rank = 0; rank < assignments.size(); ++rank) {
    const Assignment& mine = assignments[rank];
    if (mine.group.front() == static_cast<int>(rank)) {
      for (const ScreenRect& rect : mine.area) {
        for (int y = rect.pixels.y0; y < rect.pixels.y1; y += kTileSide) {
          for (int x = rect.pixels.x0; x < rect.pixels.x1; x += kTileSide) {
            group_of_tile_[layout.tile_at(rect.screen, x, y)] = drawers_.size();
          }
        }
      }
      drawers_.emplace_back();
    }
    for (const SurfaceRange& range : mine.objects) drawers_.back().push_back({range, static_cast<int>(rank)});
  }
  for (std::vector<Drawer>& drawers : drawers_) {
    std::ranges::sort(drawers, {}, [](const Drawer& drawer) { return drawer.surfaces.first; });
  }
}

int DrawnBy::rank_of(std::size_t tile, std::uint32_t surface) const {
  const std::vector<Drawer>& drawers = drawers_.at(group_of_tile_.at(tile));
  const auto after =
      std::ranges::upper_bound(drawers, surface, {}, [](const Drawer& drawer) { return drawer.surfaces.first; });
  HPR_CHECK(after != drawers.begin() && surface < std::prev(after)->surfaces.last);
  return std::prev(after)->rank;
}

}  // namespace hpr
