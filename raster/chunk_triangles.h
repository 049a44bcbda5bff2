#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "raster/geometry.h"
#include "scene/chunk_range.h"
#include "scene/scene.h"

/// Chunks as triangles, for ranks that do not hold them.
namespace hpr {

/// Some chunks of a geometry of the scene: the instance, the triangles' numbers and their corners, 36 bytes a triangle.
/// `chunks` ascend.
[[nodiscard]] std::vector<std::byte> pack_triangles(const Scene& scene, const Geometry& geometry,
                                                    std::span<const ChunkRange> chunks);

/// A geometry of what several ranks packed, no surface twice. It draws as one would that was collected of the scene:
/// instances' matrices are the scene's, positions come with the triangles.
[[nodiscard]] Geometry unpack_triangles(const Scene& scene, std::span<const std::vector<std::byte>> packed);

}  // namespace hpr
