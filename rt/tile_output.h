#pragma once

#include <cstddef>
#include <vector>

#include "rt/lighter.h"
#include "rt/passes/first_points.h"
#include "rt/passes/pass.h"

namespace hpr {

/// Whether a pixel can hold it: what does not fit is black there.
[[nodiscard]] bool fits_floats(const glm::dvec3& light);

/// The tile's sums as pixels of tile `index`. Light that is no finite number is black, in all layers, and counted.
void store(TileWork& tile, const TileJob& job, std::size_t index, const LightOutput& output);

/// Adds normal and base colour of what each pixel sees, of several surfaces each by its share.
void add_first_surfaces(const std::vector<PathPoint>& points, std::size_t index, const LightOutput& output);

/// Makes the tile active in all layers there are.
void set_active(const LightOutput& output, std::size_t tile);

}  // namespace hpr
