#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "image/key.h"
#include "rt/pass.h"

namespace hpr {

/// One sample of a tile: where it lies, who looks and what is seen.
struct TileJob {
  Rect place;
  SampleNumber number;
  std::span<const Key> keys;
  const View* view = nullptr;
  std::uint32_t first_pixel = 0;  ///< of TileWork's: those of other samples come before
};

/// Rows of a tile, from its own first one.
struct RowRange {
  int first = 0;
  int end = 0;
};

/// The first generation of points in some rows of a tile: the surfaces its keys name, and those of partial coverage
/// before them, each with the share of the pixel it covers. Adds the background where neither is.
void find_first_points(TileWork& tile, const TileJob& job, const RowRange& rows, std::vector<PathPoint>& points);

}  // namespace hpr
