#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "scene/chunk_range.h"
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

/// A corner, and the triangle of the mesh whose last corner it is. Every triangle has a last corner of its own, so that
/// its id reaches the fragments as a flat attribute: on llvmpipe a frame then takes 3/4 of the time it takes with
/// gl_PrimitiveID, which makes the driver assemble every triangle anew. It costs about two vertices per position.
struct Vertex {
  glm::vec3 position{0.0F};
  std::uint32_t triangle = 0;
};

/// Neighbouring triangles of a mesh: what is culled as one.
struct Chunk {
  std::uint32_t first = 0;  ///< triangle of the mesh
  std::uint32_t count = 0;
  std::uint32_t slot = 0;  ///< where `first` stands in Geometry::triangles; neighbours in the mesh are neighbours there
  Box box;
};

/// A run of chunks of one instance that belongs to the rank; chunks are cut to [first, last).
struct Piece {
  std::uint32_t instance = 0;
  std::uint32_t first = 0;  ///< triangles [first, last) of the instance's mesh
  std::uint32_t last = 0;
  std::size_t first_chunk = 0;
  std::size_t chunks = 0;
  Box box;
  std::uint32_t number = 0;  ///< of its first chunk, see ChunkRange: the chunks of the pieces before it

  [[nodiscard]] ChunkRange numbers() const { return {number, number + static_cast<std::uint32_t>(chunks)}; }
};

/// One rank's part of a scene, ready for upload: the triangles of each mesh once, however many instances show it.
struct Geometry {
  std::vector<Vertex> vertices;
  std::vector<glm::uvec3> triangles;  ///< into vertices
  std::vector<Chunk> chunks;
  std::vector<Piece> pieces;  ///< in ascending order of surface id

  /// All of its chunks, by their numbers.
  [[nodiscard]] ChunkRange numbers() const { return {0, pieces.empty() ? 0 : pieces.back().numbers().last}; }
};

/// Triangles of a chunk: finer ones cost cull time (under 50 ns each), coarser ones draw more than the rectangle needs.
inline constexpr std::uint32_t kChunkTriangles = 512;
/// Chunks of a piece: what one step of the cull loop handles.
inline constexpr std::size_t kPieceChunks = 64;

/// The surfaces `objects` of `scene`; the ranges may come in any order, overlap and reach past the scene's triangles.
/// Throws Error (Limit) when they have more triangles than an indirect draw can address.
[[nodiscard]] Geometry collect_geometry(const Scene& scene, std::span<const SurfaceRange> objects);

/// The pieces of some chunks: those of the geometry, cut where a range begins or ends inside of one. `chunks` ascend.
[[nodiscard]] std::vector<Piece> pieces_of(const Geometry& geometry, std::span<const ChunkRange> chunks);

}  // namespace hpr
