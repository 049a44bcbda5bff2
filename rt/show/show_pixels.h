#pragma once

#include <span>

#include "rt/passes/path_vertex.h"

namespace hpr {

/// Sets the radiance of the pixels in some rows of a tile to what settings.show says in place of light. `points`: their
/// primary vertices; those that cover a part of a pixel count by that part.
void show_pixels(const LightContext& context, const TileJob& job, const RowRange& rows, RayBuffers& buffers,
                 PixelSums& sums, std::span<const PathVertex> points);

/// Show::Cost: the radiance of the tile's pixels becomes the color of the rays that were counted for them.
void show_cost(const TileJob& job, PixelSums& sums);

}  // namespace hpr
