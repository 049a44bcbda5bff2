#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cluster/distribution/assignment.h"
#include "image/tiles.h"

namespace hpr {

/// Which rank draws which surface where.
class DrawnBy {
 public:
  /// `assignments`: every rank's.
  DrawnBy(std::span<const Assignment> assignments, const FrameLayout& layout);

  /// The first rank that draws `surface` in `tile`; there has to be one.
  [[nodiscard]] int rank_of(std::size_t tile, std::uint32_t surface) const;

 private:
  struct Drawer {
    SurfaceRange surfaces;
    int rank = 0;
  };

  std::vector<std::vector<Drawer>> drawers_;  ///< of each group that draws the same tiles, ascending
  std::vector<std::size_t> group_of_tile_;    ///< index into drawers_
};

}  // namespace hpr
