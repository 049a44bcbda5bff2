#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "raster/geometry.h"
#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {

/// Neighboring triangles of an instance.
struct SceneChunk {
  std::uint32_t instance = 0;
  SurfaceRange surfaces;
  Box box;            ///< in mesh coordinates
  float area = 0.0F;  ///< of the triangles together, in mesh coordinates
  std::uint32_t cluster = 0;
};

/// The surfaces that have keys.
struct SceneChunks {
  /// In ascending order of surface id, of at most kChunkTriangles each, with the borders that the rasterizer culls by.
  std::vector<SceneChunk> chunks;
  /// Chunks that follow each other and lie near each other, as those of small instances do, with no more triangles
  /// together than a chunk may have: what is handled as one. Ascending.
  std::vector<SurfaceRange> clusters;
};
[[nodiscard]] SceneChunks make_scene_chunks(const Scene& scene, int threads);

/// What a chunk can touch of a view.
struct ChunkBounds {
  std::uint32_t chunk = 0;
  Rect pixels;           ///< not empty; nothing of the chunk is drawn outside, whatever the jitter
  float covered = 0.0F;  ///< about how many pixels are drawn, those of surfaces behind each other too
};

/// Pixels by which a sample may lie beside the center of its pixel: the radius of the widest filter.
inline constexpr double kMaxJitter = 2.0;

/// The bounds of all chunks that a view can show, in their order; the view's own jitter does not count. Conservative as
/// Culler is. The same on every rank.
[[nodiscard]] std::vector<ChunkBounds> bound_chunks(const Scene& scene, std::span<const SceneChunk> chunks,
                                                    const View& view, int threads);

}  // namespace hpr
