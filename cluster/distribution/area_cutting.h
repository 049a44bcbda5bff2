#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "cluster/distribution/assignment.h"
#include "image/tiles.h"

namespace hpr {

/// The rows (or columns) of tiles of a rectangle, `from` on and before `end`.
[[nodiscard]] inline ScreenRect slice(const ScreenRect& rect, bool along_x, int from, int end) {
  ScreenRect part = rect;
  int& low = along_x ? part.pixels.x0 : part.pixels.y0;
  int& high = along_x ? part.pixels.x1 : part.pixels.y1;
  const int first = low;
  low = std::min(first + kTileSide * from, high);
  high = std::min(first + kTileSide * end, high);
  return part;
}

/// How many there are of them.
[[nodiscard]] inline int slices_of(const ScreenRect& rect, bool along_x) {
  const int length = along_x ? rect.pixels.width() : rect.pixels.height();
  return (length + kTileSide - 1) / kTileSide;
}

inline void add_if_any(std::vector<ScreenRect>& rects, const ScreenRect& part) {
  if (!part.pixels.empty()) rects.push_back(part);
}

/// Shares rectangles out among areas by weight, recursively by halves of them. `size_of(rect)`: what is shared;
/// `cut(rect, wanted, first, second)` moves about `wanted` of that to `first` and the rest to `second`.
template <typename SizeOf, typename Cut>
void share_out(std::vector<ScreenRect> rects, std::span<const int> weights, std::span<std::vector<ScreenRect>> areas,
               const SizeOf& size_of, const Cut& cut) {
  if (weights.size() == 1) {
    areas[0] = std::move(rects);
    return;
  }
  const std::size_t half = weights.size() / 2;
  const double fraction =
      static_cast<double>(std::accumulate(weights.begin(), weights.begin() + static_cast<std::ptrdiff_t>(half), 0)) /
      std::accumulate(weights.begin(), weights.end(), 0);
  double wanted = fraction * std::accumulate(rects.begin(), rects.end(), 0.0,
                                             [&](double sum, const ScreenRect& rect) { return sum + size_of(rect); });
  std::vector<ScreenRect> first;
  std::vector<ScreenRect> second;
  for (const ScreenRect& rect : rects) {
    const double size = size_of(rect);
    if (size <= wanted) {
      first.push_back(rect);
    } else if (wanted <= 0.0) {
      second.push_back(rect);
    } else {
      cut(rect, wanted, first, second);
    }
    wanted = std::max(0.0, wanted - size);
  }
  share_out(std::move(first), weights.first(half), areas.first(half), size_of, cut);
  share_out(std::move(second), weights.subspan(half), areas.subspan(half), size_of, cut);
}

/// All pixels of all screens.
[[nodiscard]] inline std::vector<ScreenRect> whole_screens(const FrameLayout& layout) {
  std::vector<ScreenRect> whole;
  for (std::size_t screen = 0; screen < layout.screens(); ++screen) {
    whole.push_back({screen, {0, 0, layout.size(screen).width, layout.size(screen).height}});
  }
  return whole;
}

}  // namespace hpr
