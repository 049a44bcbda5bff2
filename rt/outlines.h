#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "rt/first_points.h"
#include "rt/pass.h"

namespace hpr {

/// Whether the second place lies beside the first one, whose normal it is, and near it as the view sees it. Places are
/// metres from the view's eye.
[[nodiscard]] bool is_placed_alike(const View& view, const glm::vec3& first, const glm::vec3& second,
                                   const glm::vec3& normal);

/// Traces work.requests, which start at the eye: sets work.hits.
void trace_from_eye(TileWork& work);

/// Which pixels outlines cross: those between whose corners what is seen changes to another material, turns sharply or
/// jumps. Found by rays through the corners, which no sample has a part in: else a thin thing would be looked at more
/// closely only when a sample happens to meet it, and lose light. Kept while the views stay the same.
class Outlines {
 public:
  /// Before a frame is lit, by one thread. `views[i]` is screen i of the layout.
  void prepare(const FrameLayout& layout, std::span<const View> views);

  /// 1 for each pixel of the tile that an outline crosses. `job`: any sample of the frame. One thread at a time asks
  /// for a tile.
  [[nodiscard]] std::span<const std::uint8_t> of_tile(TileWork& work, const TileJob& job, std::size_t tile);

 private:
  using Mask = std::vector<std::uint8_t>;

  [[nodiscard]] static Mask find(TileWork& work, const TileJob& job);

  FrameLayout layout_;
  std::vector<View> views_;
  std::vector<Mask> masks_;  ///< per tile; empty: not yet known
};

}  // namespace hpr
