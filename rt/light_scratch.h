#pragma once

#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

#include "rt/half_resolution.h"
#include "rt/pass.h"

namespace hpr {

/// Points that are worked on together: enough to fill packets, few enough for the second-level cache.
inline constexpr std::size_t kWavePoints = 512;
inline constexpr int kRowsAtOnce = static_cast<int>(kWavePoints) / kTileSide;

/// The memory one thread needs for a tile. Kept from tile to tile: fresh pages would cost a tenth of the time.
struct Scratch {
  Scratch(TileWork tile_work, std::size_t times) : work(std::move(tile_work)), ms(times, 0.0) {}
  TileWork work;
  SharedLight shared;
  std::vector<std::vector<PathPoint>> waiting;  ///< by depth
  Wave wave;
  std::vector<double> ms;
};

/// While rays travel, more threads wait for theirs than there are: of the time that was spent, each step has its share.
inline void share_out(double spent_ms, std::vector<double>& ms) {
  const double sum = std::accumulate(ms.begin(), ms.end(), 0.0);
  for (double& step : ms) step *= sum > 0.0 ? spent_ms / sum : 0.0;
}

}  // namespace hpr
