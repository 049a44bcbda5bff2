#include "scene/mesh_reader.h"

#include <algorithm>
#include <bit>
#include <memory>
#include <utility>

#include "core/error.h"

namespace hpr {
namespace {

constexpr std::uint32_t kPieceVertices = 1U << 16U;
constexpr std::uint32_t kPieceTriangles = 1U << 16U;
constexpr std::uint32_t kWindow = 1U << 12U;  ///< vertices that are looked at together

template <typename MeshType, typename Visit>
decltype(auto) visit_array(MeshType& mesh, VertexArray array, const Visit& visit) {
  switch (array) {
    case VertexArray::Positions:
      return visit(mesh.positions);
    case VertexArray::Normals:
      return visit(mesh.normals);
    case VertexArray::Uvs0:
      return visit(mesh.uvs[0]);
    case VertexArray::Uvs1:
      return visit(mesh.uvs[1]);
    case VertexArray::Colors:
      return visit(mesh.colors);
    case VertexArray::Tangents:
      break;
  }
  return visit(mesh.tangents);
}

/// Calls visit(triangles) for all of some ranges, piece by piece.
template <typename Visit>
void each_piece(MeshReader& mesh, std::span<const SurfaceRange> ranges, const Visit& visit) {
  std::vector<glm::uvec3> triangles;
  for (const SurfaceRange& range : ranges) {
    for (std::uint32_t first = range.first; first < range.last;) {
      const std::uint32_t last = first + std::min(kPieceTriangles, range.last - first);
      mesh.read_triangles(first, last, triangles);
      visit(std::span<const glm::uvec3>(triangles));
      first = last;
    }
  }
}

void insert_corners(VertexSet& set, std::span<const glm::uvec3> triangles) {
  for (const glm::uvec3& triangle : triangles) {
    for (int corner = 0; corner < 3; ++corner) set.insert(triangle[corner]);
  }
}

}  // namespace

std::size_t components_of(VertexArray array) {
  switch (array) {
    case VertexArray::Positions:
    case VertexArray::Normals:
      return 3;
    case VertexArray::Uvs0:
    case VertexArray::Uvs1:
      return 2;
    default:
      return 4;
  }
}

std::span<const float> values_of(const Mesh& mesh, VertexArray array) {
  return visit_array(mesh, array, [&](const auto& values) {
    return std::span(reinterpret_cast<const float*>(values.data()), values.size() * components_of(array));
  });
}

void append_values(Mesh& mesh, VertexArray array, std::span<const float> values) {
  visit_array(mesh, array, [&]<typename Value>(std::vector<Value>& to) {
    const auto* const first = reinterpret_cast<const Value*>(values.data());
    to.insert(to.end(), first, first + values.size() / components_of(array));
  });
}

Mesh MeshReader::take() {
  Mesh mesh;
  mesh.name = name;
  mesh.material = material;
  std::vector<float> values;
  for (const VertexArray array : kVertexArrays) {
    if (!has(array)) continue;
    visit_array(mesh, array, [&](auto& to) { to.reserve(vertices()); });
    for (std::uint32_t first = 0; first < vertices();) {
      const std::uint32_t last = first + std::min(kPieceVertices, vertices() - first);
      read(array, first, last, values);
      append_values(mesh, array, values);
      first = last;
    }
  }
  mesh.triangles.reserve(triangles());
  const SurfaceRange all{0, triangles()};
  each_piece(*this, std::span(&all, 1), [&](std::span<const glm::uvec3> piece) {
    mesh.triangles.insert(mesh.triangles.end(), piece.begin(), piece.end());
  });
  return mesh;
}

WholeMeshReader::WholeMeshReader(Mesh mesh) : own_(std::move(mesh)), mesh_(&own_) {
  name = own_.name;
  material = own_.material;
}

WholeMeshReader::WholeMeshReader(const Mesh* mesh) : mesh_(mesh) {
  name = mesh->name;
  material = mesh->material;
}

std::uint32_t WholeMeshReader::vertices() const {
  return static_cast<std::uint32_t>(mesh_->positions.size());
}

void WholeMeshReader::read(VertexArray array, std::uint32_t first, std::uint32_t last, std::vector<float>& to) {
  const std::size_t width = components_of(array);
  const std::span<const float> from = values_of(*mesh_, array).subspan(first * width, (last - first) * width);
  to.assign(from.begin(), from.end());
}

void WholeMeshReader::read_triangles(std::uint32_t first, std::uint32_t last, std::vector<glm::uvec3>& to) {
  const std::span<const glm::uvec3> from = std::span(mesh_->triangles).subspan(first, last - first);
  to.assign(from.begin(), from.end());
}

void WholeMeshReader::read_positions(std::span<const std::uint32_t> vertices, std::vector<glm::vec3>& to) {
  to.resize(vertices.size());
  std::ranges::transform(vertices, to.begin(), [&](std::uint32_t vertex) { return mesh_->positions[vertex]; });
}

Mesh WholeMeshReader::take() {
  Mesh mesh;
  if (mesh_ == &own_) {
    mesh = std::move(own_);
  } else {
    mesh = *mesh_;
  }
  mesh.name = name;
  mesh.material = material;
  return mesh;
}

std::uint64_t memory_of(const MeshReader& mesh) {
  std::uint64_t bytes = std::uint64_t{mesh.triangles()} * sizeof(glm::uvec3);
  for (const VertexArray array : kVertexArrays) {
    if (mesh.has(array)) bytes += std::uint64_t{mesh.vertices()} * components_of(array) * sizeof(float);
  }
  return bytes;
}

Mesh without_triangles(MeshReader& whole) {
  PartialMesh partial;
  partial.triangles = whole.triangles();
  partial.bounds = empty_bounds();
  partial.bytes = memory_of(whole);
  partial.content = content_hash(whole);
  std::vector<float> values;
  for (std::uint32_t first = 0; first < whole.vertices();) {
    const std::uint32_t last = first + std::min(kPieceVertices, whole.vertices() - first);
    whole.read(VertexArray::Positions, first, last, values);
    for (std::size_t i = 0; i < values.size(); i += 3) {
      partial.reach = glm::max(partial.reach, glm::abs(glm::dvec3(values[i], values[i + 1], values[i + 2])));
    }
    first = last;
  }
  const SurfaceRange all{0, whole.triangles()};
  std::vector<std::uint32_t> corners;
  std::vector<glm::vec3> positions;
  static_assert(kPieceTriangles % kPartChunk == 0);
  each_piece(whole, std::span(&all, 1), [&](std::span<const glm::uvec3> triangles) {
    corners.clear();
    for (const glm::uvec3& t : triangles) corners.insert(corners.end(), {t.x, t.y, t.z});
    whole.read_positions(corners, positions);
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      if (t % kPartChunk == 0) partial.chunks.push_back(empty_bounds());
      Bounds& chunk = partial.chunks.back();
      const std::array<glm::dvec3, 3> p{positions[3 * t], positions[3 * t + 1], positions[3 * t + 2]};
      for (std::size_t corner = 0; corner < 3; ++corner) {
        chunk.low = glm::min(chunk.low, p.at(corner));
        chunk.high = glm::max(chunk.high, p.at(corner));
        partial.longest_edge = std::max(partial.longest_edge, glm::distance(p.at(corner), p.at((corner + 1) % 3)));
      }
    }
  });
  for (const Bounds& chunk : partial.chunks) partial.bounds = united(partial.bounds, chunk);
  Mesh mesh;
  mesh.name = whole.name;
  mesh.material = whole.material;
  mesh.partial = std::make_shared<const PartialMesh>(std::move(partial));
  return mesh;
}

void VertexSet::insert_missing(const VertexSet& others) {
  HPR_CHECK(others.vertices_ == vertices_);
  for (std::size_t i = 0; i < words_.size(); ++i) words_[i] |= ~others.words_[i];
  if (vertices_ % 64 != 0) words_.back() &= (std::uint64_t{1} << vertices_ % 64) - 1;
}

void VertexSet::number() {
  before_.resize(words_.size());
  size_ = 0;
  for (std::size_t i = 0; i < words_.size(); ++i) {
    before_[i] = size_;
    size_ += static_cast<std::uint32_t>(std::popcount(words_[i]));
  }
}

std::uint32_t VertexSet::number_of(std::uint32_t vertex) const {
  const std::uint64_t lower = (std::uint64_t{1} << vertex % 64) - 1;
  return before_[vertex / 64] + static_cast<std::uint32_t>(std::popcount(words_[vertex / 64] & lower));
}

PartPieces::PartPieces(MeshReader& whole, std::span<const SurfaceRange> ranges, const PartialMesh& partial)
    : whole_(whole), ranges_(ranges), partial_(partial), chosen_(whole.vertices()) {
  HPR_CHECK(whole.triangles() == partial.triangles);
  if (!ranges.empty() && ranges.front().first == 0) {
    VertexSet used(whole.vertices());
    const SurfaceRange all{0, whole.triangles()};
    each_piece(whole, std::span(&all, 1), [&](std::span<const glm::uvec3> piece) { insert_corners(used, piece); });
    chosen_.insert_missing(used);
  }
  each_piece(whole, ranges, [&](std::span<const glm::uvec3> piece) { insert_corners(chosen_, piece); });
  chosen_.number();
  for (const SurfaceRange& range : ranges) triangles_ += range.count();
}

std::optional<Mesh> PartPieces::next() {
  Mesh piece;
  if (!started_) {
    started_ = true;
    piece.name = whole_.name;
    piece.material = whole_.material;
    PartialMesh own = partial_;
    own.runs.clear();
    std::uint32_t at = 0;
    for (const SurfaceRange& range : ranges_) {
      own.runs.push_back({range.first, range.last, at});
      at += range.count();
    }
    piece.partial = std::make_shared<const PartialMesh>(std::move(own));
  } else if (next_vertex_ == whole_.vertices() && range_ == ranges_.size()) {
    return std::nullopt;
  }
  add_vertices(piece);
  if (piece.positions.empty()) add_triangles(piece);
  return piece;
}

void PartPieces::add_vertices(Mesh& piece) {
  std::vector<float> picked;
  std::vector<std::uint32_t> vertices;
  while (next_vertex_ < whole_.vertices() && piece.positions.size() + kWindow <= kPieceVertices) {
    const std::uint32_t first = next_vertex_;
    next_vertex_ += std::min(kWindow, whole_.vertices() - first);
    vertices.clear();
    for (std::uint32_t vertex = first; vertex < next_vertex_; ++vertex) {
      if (chosen_.contains(vertex)) vertices.push_back(vertex - first);
    }
    if (vertices.empty()) continue;
    for (const VertexArray array : kVertexArrays) {
      if (!whole_.has(array)) continue;
      const std::size_t width = components_of(array);
      whole_.read(array, first, next_vertex_, values_);
      picked.clear();
      for (const std::uint32_t vertex : vertices) {
        const auto* const value = &values_[vertex * width];
        picked.insert(picked.end(), value, value + width);
      }
      append_values(piece, array, picked);
    }
  }
}

void PartPieces::add_triangles(Mesh& piece) {
  while (range_ < ranges_.size() && piece.triangles.size() < kPieceTriangles) {
    const SurfaceRange& range = ranges_[range_];
    const std::uint32_t first = range.first + next_triangle_;
    const std::uint32_t count =
        std::min(range.last - first, kPieceTriangles - static_cast<std::uint32_t>(piece.triangles.size()));
    whole_.read_triangles(first, first + count, corners_);
    for (const glm::uvec3& t : corners_) {
      piece.triangles.emplace_back(chosen_.number_of(t.x), chosen_.number_of(t.y), chosen_.number_of(t.z));
    }
    next_triangle_ += count;
    if (first + count < range.last) continue;
    ++range_;
    next_triangle_ = 0;
  }
}

void append_piece(Mesh& part, Mesh piece, std::uint32_t vertices, std::uint32_t triangles) {
  const bool is_first = piece.partial != nullptr;
  if (is_first) {
    part = Mesh();
    part.name = std::move(piece.name);
    part.material = piece.material;
    part.partial = std::move(piece.partial);
    part.triangles.reserve(triangles);
  }
  for (const VertexArray array : kVertexArrays) {
    const std::span<const float> values = values_of(piece, array);
    if (values.empty()) continue;
    if (values_of(part, array).empty()) visit_array(part, array, [&](auto& to) { to.reserve(vertices); });
    append_values(part, array, values);
  }
  part.triangles.insert(part.triangles.end(), piece.triangles.begin(), piece.triangles.end());
}

}  // namespace hpr
