#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "rt/passes/path_vertex.h"

namespace hpr {

/// The pixels beyond the edges of a tile that its filters read: those where its screen goes on in another block, and
/// in another tile with RaySettings::filter_across_tiles. Both may belong to another rank. Their keys are found by
/// rays, and they are shaded once more with the noise that they have there, so that a filter sees the same on both
/// sides of the seam.
class TileMargin {
 public:
  /// How many strips a tile has: one along each edge that filters cross, and the corners between.
  [[nodiscard]] static std::size_t count(const TileJob& job, bool across_tiles);

  /// Finds the strips of a tile in one sample, `reach` pixels wide, and what they show. `first_pixel`: of the first
  /// strip's sums; each has those of a tile.
  void find(const LightContext& context, const TileJob& job, int reach, std::uint32_t first_pixel, RayBuffers& buffers);

  /// Jobs whose rectangles are the strips.
  [[nodiscard]] std::span<const TileJob> strips() const { return strips_; }

 private:
  std::vector<TileJob> strips_;
  std::vector<Key> keys_;
};

}  // namespace hpr
