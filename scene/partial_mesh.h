#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "scene/bounds.h"

namespace hpr {

class MeshReader;
struct Mesh;
struct Scene;
struct SurfaceRange;

/// What a rank has of a mesh whose triangles are shared out among ranks, and what every rank knows of all of it.
struct PartialMesh {
  /// Triangles [first, last) of the whole mesh; they stand in Mesh::triangles from `at` on.
  struct Run {
    std::uint32_t first = 0;
    std::uint32_t last = 0;
    std::uint32_t at = 0;

    bool operator==(const Run&) const = default;
  };

  std::vector<Run> runs;        ///< ascending, apart from each other
  std::uint32_t triangles = 0;  ///< of the whole mesh
  Bounds bounds;                ///< mesh_bounds of the whole mesh
  glm::dvec3 reach{0.0};        ///< the largest coordinates of the whole mesh's positions, without their signs
  double longest_edge = 0.0;    ///< longest_edge of the whole mesh
  std::uint64_t bytes = 0;      ///< that the whole mesh's arrays take
  std::uint64_t content = 0;    ///< content_hash of the whole mesh
  std::vector<Bounds> chunks;   ///< of every kPartChunk triangles; known where the mesh was read

  /// Whether triangle `t` of the whole mesh is here.
  [[nodiscard]] bool holds(std::uint32_t t) const;
  /// Where it stands in Mesh::triangles. It must be here.
  [[nodiscard]] std::uint32_t index_of(std::uint32_t t) const;
};

/// Scenes are shared out in chunks of so many triangles of a mesh, the last one of fewer.
inline constexpr std::uint32_t kPartChunk = 512;

/// What is known of a whole mesh without its arrays: none of its triangles are here.
[[nodiscard]] Mesh without_triangles(const Mesh& whole);
[[nodiscard]] Mesh without_triangles(MeshReader& whole);

/// Some triangles of a whole mesh, `ranges` ascending and apart, with the vertices they use, and with triangle 0 those
/// that no triangle of the whole mesh uses, as they count where a camera frames the scene. In the order vertices have
/// there. `partial` is what is known of all of it.
[[nodiscard]] Mesh part_of_mesh(const Mesh& whole, std::span<const SurfaceRange> ranges, const PartialMesh& partial);

/// Whether all ranks hold all of a mesh, as they need it whole: those that give light, let through some of it or bound
/// what absorbs it, and points and lines, whose shapes are not known yet.
[[nodiscard]] bool is_held_by_all(const Scene& scene, const Mesh& mesh);

/// Whether ranks hold parts of its meshes.
[[nodiscard]] bool is_shared_out(const Scene& scene);

/// The bytes that a whole scene takes, held in parts or not.
[[nodiscard]] std::uint64_t whole_memory_of(const Scene& scene);

}  // namespace hpr
