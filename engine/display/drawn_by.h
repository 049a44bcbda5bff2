#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cluster/distribution/assignment.h"
#include "cluster/distribution/view_groups.h"
#include "image/tiles.h"

namespace hpr {

/// Which rank draws which surface where.
class DrawnBy {
 public:
  /// `assignments`: every rank's.
  DrawnBy(std::span<const Assignment> assignments, const FrameLayout& layout);

  /// Of groups that follow the view.
  DrawnBy(const ViewGroups& groups, std::span<const ScreenChunk> chunks, const FrameLayout& layout);

  /// The first rank that draws `surface` in `tile`; there has to be one.
  [[nodiscard]] int rank_of(std::size_t tile, std::uint32_t surface) const;

 private:
  struct Drawer {
    SurfaceRange surfaces;
    int rank = 0;
    std::optional<Rect> tiles;  ///< of the screen's grid; none: all of its group's
  };

  FrameLayout layout_;
  std::vector<std::vector<Drawer>> drawers_;  ///< of each group that draws the same tiles, or each screen, ascending
  std::vector<std::size_t> group_of_tile_;    ///< index into drawers_
};

}  // namespace hpr
