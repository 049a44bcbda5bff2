#include "raster/geometry.h"

#include <fmt/format.h>

#include <algorithm>
#include <glm/common.hpp>
#include <limits>

#include "core/error.h"
#include "scene/scene.h"

namespace hpr {
namespace {

/// Where a mesh's chunks stand in Geometry::chunks.
struct ChunkRun {
  std::size_t first = 0;
  std::size_t last = 0;
};

/// The index of each of a mesh's vertices in Geometry::vertices; kNowhere if it does not yet.
using VertexIndices = std::vector<std::uint32_t>;
constexpr std::uint32_t kNowhere = std::numeric_limits<std::uint32_t>::max();

/// Appends triangles [first, last): each owns the vertex of its last corner, other corners share whatever vertex has
/// their position.
void append_chunk(const Mesh& mesh, std::uint32_t first, std::uint32_t last, VertexIndices& indices,
                  Geometry& geometry) {
  Chunk chunk{first, last - first, static_cast<std::uint32_t>(geometry.triangles.size()), {}};
  const glm::vec3 start = mesh.positions[mesh.triangle(first).x];
  chunk.box = {start, start};
  const auto add_vertex = [&](std::uint32_t vertex, std::uint32_t triangle) {
    indices[vertex] = static_cast<std::uint32_t>(geometry.vertices.size());
    geometry.vertices.push_back({mesh.positions[vertex], triangle});
  };
  const auto own_corner = static_cast<std::uint32_t>(geometry.vertices.size());
  for (std::uint32_t t = first; t < last; ++t) add_vertex(mesh.triangle(t).z, t);
  for (std::uint32_t t = first; t < last; ++t) {
    glm::uvec3 moved(0U, 0U, own_corner + (t - first));
    for (int corner = 0; corner < 3; ++corner) {
      const std::uint32_t vertex = mesh.triangle(t)[corner];
      chunk.box.add({mesh.positions[vertex], mesh.positions[vertex]});
      if (corner == 2) continue;
      if (indices[vertex] == kNowhere) add_vertex(vertex, t);  // nobody's last corner so far
      moved[corner] = indices[vertex];
    }
    geometry.triangles.push_back(moved);
  }
  geometry.chunks.push_back(chunk);
}

/// Appends the triangles of `ranges` in chunks, with borders at fixed multiples, so that instances that share a mesh
/// share its chunks.
ChunkRun append_mesh(const Mesh& mesh, const std::vector<SurfaceRange>& ranges, Geometry& geometry) {
  VertexIndices indices(mesh.positions.size(), kNowhere);
  const std::size_t first_chunk = geometry.chunks.size();
  for (const SurfaceRange& range : ranges) {
    for (std::uint32_t first = range.first; first < range.last;) {
      const std::uint32_t last = std::min(range.last, (first / kChunkTriangles + 1) * kChunkTriangles);
      append_chunk(mesh, first, last, indices, geometry);
      first = last;
    }
  }
  return {first_chunk, geometry.chunks.size()};
}

/// Cuts one instance's part into pieces along the chunks of its mesh.
void append_pieces(const InstanceRange& part, const ChunkRun& run, Geometry& geometry) {
  const auto begin = geometry.chunks.begin();
  const auto meets = [&](const Chunk& chunk) { return chunk.first + chunk.count <= part.range.first; };
  auto chunk = std::partition_point(begin + static_cast<std::ptrdiff_t>(run.first),
                                    begin + static_cast<std::ptrdiff_t>(run.last), meets);
  const auto end = begin + static_cast<std::ptrdiff_t>(run.last);
  while (chunk != end && chunk->first < part.range.last) {
    Piece piece{part.instance,
                std::max(chunk->first, part.range.first),
                0,
                static_cast<std::size_t>(chunk - begin),
                0,
                chunk->box,
                geometry.numbers().last};
    for (; chunk != end && chunk->first < part.range.last && piece.chunks < kPieceChunks; ++chunk, ++piece.chunks) {
      piece.last = std::min(chunk->first + chunk->count, part.range.last);
      piece.box.add(chunk->box);
    }
    geometry.pieces.push_back(piece);
  }
}

}  // namespace

Geometry collect_geometry(const Scene& scene, std::span<const SurfaceRange> objects) {
  const std::vector<SurfaceRange> ranges = merged_ranges({objects.begin(), objects.end()}, scene.triangles);
  const std::vector<InstanceRange> parts = split_by_instance(scene, ranges);

  std::vector<std::vector<SurfaceRange>> wanted(scene.meshes.size());
  for (const InstanceRange& part : parts) wanted[scene.instances[part.instance].mesh].push_back(part.range);
  std::uint64_t triangles = 0;
  for (std::size_t mesh = 0; mesh < wanted.size(); ++mesh) {
    wanted[mesh] = merged_ranges(std::move(wanted[mesh]), scene.meshes[mesh].triangle_count());
    for (const SurfaceRange& range : wanted[mesh]) triangles += range.count();
  }
  // Indirect draws address the index buffer with 32 bits, three indices a triangle.
  constexpr std::uint64_t kMaxTriangles = std::numeric_limits<std::uint32_t>::max() / 3;
  if (triangles > kMaxTriangles) {
    throw Error(
        ExitCode::Limit,
        fmt::format("one rank's share has {} distinct triangles; OpenGL addresses {}", triangles, kMaxTriangles),
        "use more ranks with --distribute sort-last");
  }

  Geometry geometry;
  geometry.triangles.reserve(triangles);
  std::vector<ChunkRun> runs(scene.meshes.size());
  for (std::size_t mesh = 0; mesh < wanted.size(); ++mesh) {
    if (!wanted[mesh].empty()) runs[mesh] = append_mesh(scene.meshes[mesh], wanted[mesh], geometry);
  }
  for (const InstanceRange& part : parts) append_pieces(part, runs[scene.instances[part.instance].mesh], geometry);
  return geometry;
}

namespace {

/// Of a piece the chunks that have numbers in `range`, which has some of them.
Piece cut(const Geometry& geometry, const Piece& piece, const ChunkRange& range) {
  Piece part = piece;
  const std::uint32_t first = std::max(range.first, piece.number);
  const std::uint32_t last = std::min(range.last, piece.numbers().last);
  part.first_chunk += first - piece.number;
  part.chunks = last - first;
  part.number = first;
  const Chunk& begin = geometry.chunks[part.first_chunk];
  const Chunk& end = geometry.chunks[part.first_chunk + part.chunks - 1];
  part.first = std::max(piece.first, begin.first);
  part.last = std::min(piece.last, end.first + end.count);
  part.box = begin.box;
  for (const Chunk& chunk : std::span(geometry.chunks).subspan(part.first_chunk, part.chunks)) part.box.add(chunk.box);
  return part;
}

}  // namespace

std::vector<Piece> pieces_of(const Geometry& geometry, std::span<const ChunkRange> chunks) {
  std::vector<Piece> pieces;
  for (const ChunkRange& range : chunks) {
    auto piece = std::ranges::partition_point(geometry.pieces,
                                              [&](const Piece& each) { return each.numbers().last <= range.first; });
    for (; piece != geometry.pieces.end() && piece->number < range.last; ++piece) {
      const bool whole = range.first <= piece->number && piece->numbers().last <= range.last;
      pieces.push_back(whole ? *piece : cut(geometry, *piece, range));
    }
  }
  return pieces;
}

}  // namespace hpr
