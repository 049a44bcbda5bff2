#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "image/tiles.h"
#include "raster/geometry.h"
#include "scene/chunk_range.h"
#include "scene/view.h"

namespace hpr {

/// Some chunks, by the areas of a view that they may touch.
struct ChunkBins {
  std::vector<std::vector<ChunkRange>> areas;  ///< ascending; a chunk stands in each whose pixels it may touch
  std::uint64_t chunks_culled = 0;             ///< those that stand in none
};

/// Projects `chunks` of the geometry once and looks up which of the `areas` of the view they may touch: every chunk of
/// which a Culler of an area's rectangle would have a pixel drawn stands in that area's list, and few others do. One
/// that reaches behind the eye may stand in all of them. Rectangles are inside the view.
[[nodiscard]] ChunkBins bin_chunks(const Scene& scene, const Geometry& geometry, const ChunkRange& chunks,
                                   const View& view, std::span<const std::vector<Rect>> areas, int threads);

}  // namespace hpr
