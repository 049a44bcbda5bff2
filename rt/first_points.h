#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "image/key.h"
#include "rt/pass.h"

namespace hpr {

/// A tile, where it lies and what it becomes.
struct TileJob {
  Rect place;
  SampleNumber number;
  std::span<const Key> keys;
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
