#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace hpr {

/// What a mesh may have for each of its vertices, in the order in which it is hashed.
enum class VertexArray : std::uint8_t { Positions, Normals, Uvs0, Uvs1, Colors, Tangents };
inline constexpr std::array<VertexArray, 6> kVertexArrays{VertexArray::Positions, VertexArray::Normals,
                                                          VertexArray::Uvs0,      VertexArray::Uvs1,
                                                          VertexArray::Colors,    VertexArray::Tangents};

/// The numbers of one vertex.
[[nodiscard]] std::size_t components_of(VertexArray array);
/// A mesh's array as numbers; empty where it has none.
[[nodiscard]] std::span<const float> values_of(const Mesh& mesh, VertexArray array);
void append_values(Mesh& mesh, VertexArray array, std::span<const float> values);

/// The arrays of a whole mesh, in memory or in a file, a piece at a time.
class MeshReader {
 public:
  MeshReader() = default;
  MeshReader(const MeshReader&) = delete;
  MeshReader& operator=(const MeshReader&) = delete;
  virtual ~MeshReader() = default;

  [[nodiscard]] virtual std::uint32_t vertices() const = 0;
  [[nodiscard]] virtual std::uint32_t triangles() const = 0;
  [[nodiscard]] virtual bool has(VertexArray array) const = 0;

  /// Replaces `to` by the values of vertices [first, last), or the triangles [first, last). All that a mesh has to be
  /// is true of them: values are finite, vertices of triangles exist. Throws Error.
  virtual void read(VertexArray array, std::uint32_t first, std::uint32_t last, std::vector<float>& to) = 0;
  virtual void read_triangles(std::uint32_t first, std::uint32_t last, std::vector<glm::uvec3>& to) = 0;
  /// The positions of some vertices.
  virtual void read_positions(std::span<const std::uint32_t> vertices, std::vector<glm::vec3>& to) = 0;
  /// All of it; to be called once, and nothing after it.
  [[nodiscard]] virtual Mesh take();

  // As the scene has them: no part of what is read.
  std::string name;
  std::uint32_t material = 0;
};

/// Reads a mesh that is in memory.
class WholeMeshReader final : public MeshReader {
 public:
  explicit WholeMeshReader(Mesh mesh);
  /// Reads one that others keep.
  explicit WholeMeshReader(const Mesh* mesh);

  [[nodiscard]] std::uint32_t vertices() const override;
  [[nodiscard]] std::uint32_t triangles() const override { return mesh_->triangle_count(); }
  [[nodiscard]] bool has(VertexArray array) const override { return !values_of(*mesh_, array).empty(); }
  void read(VertexArray array, std::uint32_t first, std::uint32_t last, std::vector<float>& to) override;
  void read_triangles(std::uint32_t first, std::uint32_t last, std::vector<glm::uvec3>& to) override;
  void read_positions(std::span<const std::uint32_t> vertices, std::vector<glm::vec3>& to) override;
  [[nodiscard]] Mesh take() override;

 private:
  Mesh own_;
  const Mesh* mesh_;
};

/// What memory_of() and content_hash() say of the mesh.
[[nodiscard]] std::uint64_t memory_of(const MeshReader& mesh);
[[nodiscard]] std::uint64_t content_hash(MeshReader& mesh);

/// Some vertices of a mesh, at a bit and a half each that the mesh has.
class VertexSet {
 public:
  explicit VertexSet(std::uint32_t vertices) : words_((std::size_t{vertices} + 63) / 64), vertices_(vertices) {}

  void insert(std::uint32_t vertex) { words_[vertex / 64] |= std::uint64_t{1} << vertex % 64; }
  [[nodiscard]] bool contains(std::uint32_t vertex) const { return (words_[vertex / 64] >> vertex % 64 & 1U) != 0; }
  /// Adds those that another set of the same mesh lacks.
  void insert_missing(const VertexSet& others);

  /// Numbers the vertices in ascending order; to be called before the two below.
  void number();
  [[nodiscard]] std::uint32_t size() const { return size_; }
  [[nodiscard]] std::uint32_t number_of(std::uint32_t vertex) const;

 private:
  std::vector<std::uint64_t> words_;
  std::vector<std::uint32_t> before_;  ///< of each word: how many vertices stand in those before it
  std::uint32_t vertices_;
  std::uint32_t size_ = 0;
};

/// Makes a part of a mesh (see part_of_mesh) in pieces, to be put together with append_piece().
class PartPieces {
 public:
  /// All three must outlive this.
  PartPieces(MeshReader& whole, std::span<const SurfaceRange> ranges, const PartialMesh& partial);

  /// Of the part.
  [[nodiscard]] std::uint32_t vertices() const { return chosen_.size(); }
  [[nodiscard]] std::uint32_t triangles() const { return triangles_; }
  /// The next piece; the first one has what is known of all of the mesh. None when all were made.
  [[nodiscard]] std::optional<Mesh> next();

 private:
  void add_vertices(Mesh& piece);
  void add_triangles(Mesh& piece);

  MeshReader& whole_;
  std::span<const SurfaceRange> ranges_;
  const PartialMesh& partial_;
  VertexSet chosen_;
  std::uint32_t triangles_ = 0;
  bool started_ = false;
  std::uint32_t next_vertex_ = 0;  ///< of the whole mesh
  std::size_t range_ = 0;
  std::uint32_t next_triangle_ = 0;  ///< of that range, from its first one on
  std::vector<float> values_;
  std::vector<glm::uvec3> corners_;
};

/// Adds a piece to a part that is to have so many vertices and triangles. The first piece replaces `part`.
void append_piece(Mesh& part, Mesh piece, std::uint32_t vertices, std::uint32_t triangles);

}  // namespace hpr
