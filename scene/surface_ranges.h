#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "scene/scene.h"

namespace hpr {

/// Part of an instance: triangles [range.first, range.last) of its mesh.
struct InstanceRange {
  std::uint32_t instance = 0;
  SurfaceRange range;
};

/// Merges ranges into sorted, disjoint ones that do not touch, inside [0, end), of the same surfaces. `ranges` may come
/// in any order, overlap and reach past `end`.
[[nodiscard]] std::vector<SurfaceRange> merged_ranges(std::vector<SurfaceRange> ranges, std::uint32_t end);

/// Merged ranges of surface ids cut at the borders of instances, in ascending order.
[[nodiscard]] std::vector<InstanceRange> split_by_instance(const Scene& scene, const std::vector<SurfaceRange>& ranges);

/// What two lists of merged ranges have in common, merged too.
[[nodiscard]] std::vector<SurfaceRange> common_ranges(const std::vector<SurfaceRange>& a,
                                                      const std::vector<SurfaceRange>& b);

/// The surfaces whose materials cover all (or, `alpha_tested`, only part) of what is behind them, as ranges of surface
/// ids.
[[nodiscard]] std::vector<SurfaceRange> covering_surfaces(const Scene& scene, bool alpha_tested);

}  // namespace hpr
