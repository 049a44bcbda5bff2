#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "rt/half_resolution.h"
#include "rt/pass.h"

namespace hpr {

/// The memory one thread needs for a tile. Kept from tile to tile: fresh pages would cost a tenth of the time.
struct Scratch {
  Scratch(TileWork tile_work, std::size_t times) : work(std::move(tile_work)), ms(times, 0.0) {}
  TileWork work;
  SharedLight shared;
  std::vector<std::vector<PathPoint>> waiting;  ///< by depth
  Wave wave;
  std::vector<double> ms;
};

/// Sums of so many pixels, tile after tile, made 0 where they are wanted, which is everywhere when the mask is empty.
inline void clear_sums(std::vector<glm::dvec3>& sums, std::size_t pixels, std::span<const std::uint8_t> wanted) {
  if (wanted.empty()) {
    sums.assign(pixels, glm::dvec3(0.0));
    return;
  }
  sums.resize(pixels);
  for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
    if (wanted[pixel % kTilePixels] != 0) sums[pixel] = glm::dvec3(0.0);
  }
}

/// While rays travel, more threads wait for theirs than there are: of the time that was spent, each step has its share.
inline void share_out(double spent_ms, std::vector<double>& ms) {
  const double sum = std::accumulate(ms.begin(), ms.end(), 0.0);
  for (double& step : ms) step *= sum > 0.0 ? spent_ms / sum : 0.0;
}

}  // namespace hpr
