#include "engine/display/drawn_by.h"

#include <algorithm>
#include <iterator>

#include "core/error.h"

namespace hpr {

DrawnBy::DrawnBy(std::span<const Assignment> assignments, const FrameLayout& layout)
    : layout_(layout), group_of_tile_(layout.tiles()) {
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
    for (const SurfaceRange& range : mine.objects) drawers_.back().push_back({range, static_cast<int>(rank), {}});
  }
  for (std::vector<Drawer>& drawers : drawers_) {
    std::ranges::sort(drawers, {}, [](const Drawer& drawer) { return drawer.surfaces.first; });
  }
}

DrawnBy::DrawnBy(const ViewGroups& groups, std::span<const ScreenChunk> chunks, const FrameLayout& layout)
    : layout_(layout), drawers_(layout.screens()), group_of_tile_(layout.tiles()) {
  for (std::size_t tile = 0; tile < layout.tiles(); ++tile) group_of_tile_[tile] = layout.place(tile).screen;
  for (std::size_t rank = 0; rank < groups.parts.size(); ++rank) {
    for (const ViewGroups::Part& part : groups.parts[rank]) {
      const ScreenChunk& chunk = chunks[part.chunk];
      drawers_[chunk.screen].push_back({chunk.surfaces, static_cast<int>(rank), part.tiles});
    }
  }
  for (std::vector<Drawer>& drawers : drawers_) {
    std::ranges::stable_sort(drawers, {}, [](const Drawer& drawer) { return drawer.surfaces.first; });
  }
}

int DrawnBy::rank_of(std::size_t tile, std::uint32_t surface) const {
  const std::vector<Drawer>& drawers = drawers_.at(group_of_tile_.at(tile));
  const Rect pixels = layout_.place(tile).pixels;
  const auto draws = [&](const Drawer& drawer) {
    const Rect position{pixels.x0 / kTileSide, pixels.y0 / kTileSide, pixels.x0 / kTileSide + 1,
                        pixels.y0 / kTileSide + 1};
    return !drawer.tiles || !intersection(*drawer.tiles, position).empty();
  };
  const auto after =
      std::ranges::upper_bound(drawers, surface, {}, [](const Drawer& drawer) { return drawer.surfaces.first; });
  HPR_CHECK(after != drawers.begin() && surface < std::prev(after)->surfaces.last);
  // The ranks that draw one chunk stand beside each other, ascending.
  const auto first = std::ranges::lower_bound(drawers.begin(), after, std::prev(after)->surfaces.first, {},
                                              [](const Drawer& drawer) { return drawer.surfaces.first; });
  const auto drawer = std::ranges::find_if(first, after, draws);
  HPR_CHECK(drawer != after);
  return drawer->rank;
}

}  // namespace hpr
