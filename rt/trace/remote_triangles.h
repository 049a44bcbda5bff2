#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <unordered_map>
#include <vector>

#include "scene/scene.h"

namespace hpr {

/// A triangle as it travels to a rank that holds it not: its corners, in the mesh's own coordinates.
struct TriangleRecord {
  std::array<glm::vec3, 3> positions{};
  std::array<glm::vec3, 3> normals{};
  std::array<std::array<glm::vec2, 3>, 2> uvs{};
  std::array<glm::vec4, 3> colors{};
  std::array<glm::vec4, 3> tangents{};
  std::uint32_t arrays = 0;  ///< which of those after the normals the mesh has, a bit each
};

/// That of a surface that is here.
[[nodiscard]] TriangleRecord record_of(const Scene& scene, std::uint32_t surface);
/// A mesh of that one triangle.
[[nodiscard]] std::shared_ptr<const Mesh> mesh_of(const TriangleRecord& record, std::uint32_t material);

/// Triangles that came from other ranks, as many as fit. Any thread may call it.
class RemoteTriangles {
 public:
  /// Keeps from `count` to twice as many, those that were used last; about 0.6 kB each. Before others call it.
  void set_capacity(std::size_t count) { per_shard_ = count / kShards + 1; }
  /// Null where it is not here, or not any more.
  [[nodiscard]] std::shared_ptr<const Mesh> find(std::uint32_t surface);
  void add(std::uint32_t surface, std::shared_ptr<const Mesh> triangle);

 private:
  static constexpr std::size_t kShards = 64;
  using Triangles = std::unordered_map<std::uint32_t, std::shared_ptr<const Mesh>>;
  struct Shard {
    std::mutex mutex;
    Triangles recent;
    Triangles older;  ///< which `recent` was before it was full
  };
  /// By Fibonacci hashing (Knuth, The Art of Computer Programming, volume 3, section 6.4), as neighbors are met
  /// together.
  [[nodiscard]] Shard& shard_of(std::uint32_t surface) { return shards_[surface * 2654435769U >> 26U]; }
  void keep(Shard& shard, std::uint32_t surface, std::shared_ptr<const Mesh> triangle) const;

  std::array<Shard, kShards> shards_;
  std::size_t per_shard_ = 256;
};

/// Who holds a surface that not all hold: a rank, or a page of one.
class SurfaceOwners {
 public:
  SurfaceOwners() = default;
  /// Of each holder what it has, ranges that share no surface.
  explicit SurfaceOwners(std::span<const std::vector<SurfaceRange>> parts);

  [[nodiscard]] bool is_empty() const { return ranges_.empty(); }
  /// The number of its holder; there must be one.
  [[nodiscard]] std::size_t holder_of(std::uint32_t surface) const;

 private:
  struct Range {
    std::uint32_t first = 0;
    std::uint32_t last = 0;
    std::size_t holder = 0;
  };
  std::vector<Range> ranges_;  ///< ascending
};

}  // namespace hpr
