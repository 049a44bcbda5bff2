#include "raster/chunk_triangles.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <limits>

#include "core/error.h"

namespace hpr {
namespace {

/// Before the corners of a chunk's triangles.
struct ChunkHeader {
  std::uint32_t instance = 0;
  std::uint32_t first = 0;  ///< triangle of the instance's mesh
  std::uint32_t count = 0;
};

using Corners = std::array<glm::vec3, 3>;

template <typename T>
void append(std::vector<std::byte>& bytes, const T& value) {
  const auto more = std::as_bytes(std::span(&value, 1));
  bytes.insert(bytes.end(), more.begin(), more.end());
}

template <typename T>
T take(std::span<const std::byte>& bytes) {
  HPR_CHECK(bytes.size() >= sizeof(T));
  T value;
  std::memcpy(&value, bytes.data(), sizeof(T));
  bytes = bytes.subspan(sizeof(T));
  return value;
}

/// A chunk and its piece; vertices are not shared between triangles.
void append_chunk(std::span<const std::byte>& bytes, Geometry& geometry) {
  const auto header = take<ChunkHeader>(bytes);
  HPR_CHECK(header.count > 0);
  Chunk chunk{header.first, header.count, static_cast<std::uint32_t>(geometry.triangles.size()), {}};
  for (std::uint32_t i = 0; i < header.count; ++i) {
    const auto corners = take<Corners>(bytes);
    const auto vertex = static_cast<std::uint32_t>(geometry.vertices.size());
    if (i == 0) chunk.box = {corners[0], corners[0]};
    for (const glm::vec3& corner : corners) {
      geometry.vertices.push_back({corner, header.first + i});
      chunk.box.add({corner, corner});
    }
    geometry.triangles.push_back(glm::uvec3(0U, 1U, 2U) + vertex);
  }
  geometry.pieces.push_back(
      {header.instance, header.first, header.first + header.count, geometry.chunks.size(), 1, chunk.box, 0});
  geometry.chunks.push_back(chunk);
}

}  // namespace

std::vector<std::byte> pack_triangles(const Scene& scene, const Geometry& geometry,
                                      std::span<const ChunkRange> chunks) {
  std::vector<std::byte> bytes;
  for (const Piece& piece : pieces_of(geometry, chunks)) {
    const Mesh& mesh = scene.mesh_of(scene.instances[piece.instance]);
    for (const Chunk& chunk : std::span(geometry.chunks).subspan(piece.first_chunk, piece.chunks)) {
      const std::uint32_t first = std::max(chunk.first, piece.first);
      const std::uint32_t last = std::min(chunk.first + chunk.count, piece.last);
      append(bytes, ChunkHeader{piece.instance, first, last - first});
      for (std::uint32_t t = first; t < last; ++t) {
        const glm::uvec3& corners = mesh.triangle(t);
        append(bytes, Corners{mesh.positions[corners.x], mesh.positions[corners.y], mesh.positions[corners.z]});
      }
    }
  }
  return bytes;
}

Geometry unpack_triangles(const Scene& scene, std::span<const std::vector<std::byte>> packed) {
  Geometry geometry;
  std::size_t size = 0;
  for (const std::vector<std::byte>& bytes : packed) size += bytes.size();
  if (size / sizeof(Corners) > std::numeric_limits<std::uint32_t>::max() / 3) {
    throw Error(ExitCode::Limit, "more triangles are seen in one rank's tiles than OpenGL addresses",
                "use more ranks, or --distribute sort-last");
  }
  geometry.vertices.reserve(size / sizeof(glm::vec3));
  geometry.triangles.reserve(size / sizeof(Corners));
  for (std::span<const std::byte> bytes : packed) {
    while (!bytes.empty()) append_chunk(bytes, geometry);
  }
  std::ranges::sort(geometry.pieces, {},
                    [&](const Piece& piece) { return scene.instances[piece.instance].first_surface + piece.first; });
  for (std::size_t i = 0; i < geometry.pieces.size(); ++i) geometry.pieces[i].number = static_cast<std::uint32_t>(i);
  return geometry;
}

}  // namespace hpr
