#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "scene/scene.h"

namespace hpr {

/// Closed, in mesh coordinates.
struct Box {
  glm::vec3 low{0.0F};
  glm::vec3 high{0.0F};

  void add(const Box& other) {
    low = glm::min(low, other.low);
    high = glm::max(high, other.high);
  }
};

/// Neighbouring triangles of a mesh: what is culled as one.
struct Chunk {
  std::uint32_t first = 0;  ///< triangle of the mesh
  std::uint32_t count = 0;
  std::uint32_t slot = 0;  ///< where `first` stands in Geometry::triangles; neighbours in the mesh are neighbours there
  Box box;
};

/// A run of chunks of one instance that belongs to the share; chunks are cut to [first, last).
struct Piece {
  std::uint32_t instance = 0;
  std::uint32_t first = 0;  ///< triangles [first, last) of the instance's mesh
  std::uint32_t last = 0;
  std::size_t first_chunk = 0;
  std::size_t chunks = 0;
  Box box;
};

/// A share of a scene, ready for upload: the triangles of each mesh once, however many instances show it.
struct Geometry {
  std::vector<glm::vec3> positions;   ///< only those some triangle uses
  std::vector<glm::uvec3> triangles;  ///< into positions
  std::vector<Chunk> chunks;
  std::vector<Piece> pieces;  ///< in ascending order of surface id
};

/// Triangles of a chunk. Measured on llvmpipe: docs of the bench; finer chunks cost cull time, coarser ones draw more
/// than the rectangle needs.
inline constexpr std::uint32_t kChunkTriangles = 512;
/// Chunks of a piece: what one step of the cull loop handles.
inline constexpr std::size_t kPieceChunks = 64;

/// The share `objects` of `scene`; the ranges may come in any order, overlap and reach past the scene's triangles.
/// Throws Error (Limit) when the share has more triangles than an indirect draw can address.
[[nodiscard]] Geometry collect_geometry(const Scene& scene, std::span<const SurfaceRange> objects);

}  // namespace hpr
