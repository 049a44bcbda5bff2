#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <memory>
#include <span>
#include <vector>

#include "rt/trace/ray_scene.h"
#include "scene/scene.h"

namespace hpr {

class RayForwarding;

/// A triangle of the scene in world coordinates.
struct WorldTriangle {
  std::uint32_t surface = 0xFFFFFFFFU;
  std::uint32_t instance = 0;
  std::uint32_t index = 0;  ///< in the instance's mesh
  glm::dvec3 v0{0.0};
  glm::dvec3 e1{0.0};
  glm::dvec3 e2{0.0};
  glm::dvec3 normal{0.0};               ///< unit length, by the winding; zero when the triangle has no area
  std::array<glm::dvec3, 3> normals{};  ///< unit length, of the corners
  /// Metres by which ray origins must leave it, wherever they lie on it; of refined ones this is more than is needed,
  /// see refined_offset. Where they do asks for RaySpace::rounding_at.
  double offset = 0.0;
  /// The mesh of it alone, where another rank holds it; null: the scene has it.
  std::shared_ptr<const Mesh> remote;
};

/// Where a ray meets a surface, and all that shading needs of the place. World coordinates, metres.
struct SurfacePoint {
  glm::dvec3 position{0.0};          ///< v0 + u e1 + v e2
  glm::dvec3 to_viewer{0.0};         ///< unit length, against the ray
  glm::dvec3 geometric_normal{0.0};  ///< unit length, on the viewer's side
  glm::dvec3 shading_normal{0.0};    ///< unit length, interpolated, on the geometric normal's side
  /// Lifts the origin of shadow rays onto the smooth surface the normals pretend (zero on flat ones).
  glm::dvec3 lift{0.0};
  double offset = 0.0;  ///< metres by which ray origins must leave the surface along the geometric normal
  std::array<glm::vec2, 2> uv{};
  glm::dvec4 color{1.0};  ///< interpolated of the vertices, linear RGBA; 1 where they have none
  /// World, for normal maps: where the map's x and y point, so that x tangent + y bitangent + z shading_normal is on
  /// the viewer's side. Of unit length and at right angles but for what the file's own tangents are not; zero where
  /// the material has no normal map or the surface no texture coordinates.
  glm::dvec3 tangent{0.0};
  glm::dvec3 bitangent{0.0};
  std::uint32_t surface = 0xFFFFFFFFU;
  std::uint32_t material = 0;
  /// 0; of materials that cover in part a number for the side of this part of this instance, which few others have:
  /// photons of one layer don't light another, however close they lie.
  std::uint8_t layer = 0;
  bool inside = false;  ///< the viewer is behind the face, by its winding; mirroring instances swap it

  /// The normal to shade with. A smooth one at a silhouette may turn away from the viewer; the geometric one never does
  /// and stands in for it there.
  [[nodiscard]] const glm::dvec3& facing_normal() const {
    return glm::dot(shading_normal, to_viewer) > 0.0 ? shading_normal : geometric_normal;
  }
};

/// Where a ray meets a surface, as far as it matters for which of two lies before the other. Those of one plane are
/// told apart by what they are: the order of a decal and what it is on is no matter of rounding.
struct SurfacePlane {
  glm::dvec3 position{0.0};
  glm::dvec3 normal{0.0};  ///< unit length, on the viewer's side; zero: none
  double tolerance = 0.0;  ///< metres, see Surfaces::coplanar_tolerance
};

/// Where rays leave a surface towards `direction`: off it, on that side.
[[nodiscard]] inline glm::dvec3 ray_origin(const SurfacePoint& point, const glm::dvec3& direction) {
  const double side = glm::dot(direction, point.geometric_normal) < 0.0 ? -1.0 : 1.0;
  return point.position + side * point.offset * point.geometric_normal;
}

/// Surface ids -> triangles -> points. Keeps per instance what every one of its triangles needs.
class Surfaces {
 public:
  /// The scene must outlive this. Without `lifts` points have none, for whoever sends no shadow rays. `others` gets the
  /// triangles that are not here, where those are called for inside RayForwarding::for_each.
  Surfaces(const Scene& scene, const RaySpace& space, bool lifts = true, RayForwarding* others = nullptr);

  /// Sets `triangle` to surface `id` unless it already is; neighbouring pixels mostly share theirs, or the instance.
  /// Waits for one that another rank holds, unless prefetch() got it.
  void load(std::uint32_t id, WorldTriangle& triangle) const;

  /// Whether other ranks hold some of the triangles.
  [[nodiscard]] bool are_shared_out() const { return others_ != nullptr; }

  /// Asks the memory for the triangles of `ids`, kNoSurface left out, which will be loaded next: they lie far apart.
  /// Waits for those that other ranks hold, all together. `generation`: of the rays that met them.
  void prefetch(std::span<const std::uint32_t> ids, std::uint16_t generation = 0) const;

  /// The point where the ray meets the triangle's plane, moved onto the triangle when it lies outside (a pixel's centre
  /// may miss a triangle it was given by a hair). Exact to double rounding: nothing is read from depths.
  [[nodiscard]] SurfacePoint meet(const WorldTriangle& triangle, const glm::dvec3& origin,
                                  const glm::dvec3& direction) const;

  /// The plane there, which costs less than all that meet() finds.
  [[nodiscard]] SurfacePlane plane(const WorldTriangle& triangle, const glm::dvec3& origin,
                                   const glm::dvec3& direction) const;

  /// Metres by which two surfaces that a file puts in one plane may lie apart where they meet, for each of them: what
  /// the rounding of the mesh's own coordinates comes to along the normal, and what SurfacePoint::offset is for.
  [[nodiscard]] double coplanar_tolerance(const WorldTriangle& triangle, double offset) const;

  /// What is kept of an instance.
  struct Placed {
    glm::dmat3 normal_matrix{
        1.0};  ///< cofactors: the inverse transpose up to its sign and size, defined even if singular
    bool swaps_handedness = false;  ///< turns windings round
    bool is_refined = false;        ///< see refined_instances
    bool is_instanced = false;      ///< in the ray scene, whose rays are carried into its coordinates and back
    glm::dmat3 spread{0.0};         ///< |A| |A^-1| of the instanced mesh: how far the rounding of a coordinate reaches
    glm::dvec3 reach{0.0};          ///< metres: |A| |vertex| + spread |translation|
  };
  /// Per instance of the scene.
  [[nodiscard]] std::span<const Placed> placed() const { return placed_; }
  /// Which part each triangle of a mesh belongs to (parts_of); empty but for meshes that cover in part.
  [[nodiscard]] std::span<const std::uint32_t> parts(std::uint32_t mesh) const { return parts_[mesh]; }
  [[nodiscard]] const RaySpace& space() const { return space_; }
  [[nodiscard]] bool lifts() const { return lifts_; }

 private:
  /// Barycentric coordinates of a triangle's corners.
  using Weights = std::array<double, 3>;

  /// The mesh that has a loaded triangle, and its vertices there.
  [[nodiscard]] const Mesh& mesh_of(const WorldTriangle& triangle) const {
    return triangle.remote ? *triangle.remote : scene_.mesh_of(scene_.instances[triangle.instance]);
  }
  [[nodiscard]] static const glm::uvec3& corners_of(const Mesh& mesh, const WorldTriangle& triangle) {
    return mesh.triangle(triangle.remote ? 0 : triangle.index);
  }
  /// Where a ray meets a triangle's plane.
  struct PlanePoint {
    glm::dvec2 on_triangle{0.0};  ///< barycentric, moved onto the triangle
    glm::dvec2 at{0.0};           ///< the same, but for refined triangles, which textures and the place go on beside
    glm::dvec3 position{0.0};
    glm::dvec3 to_viewer{0.0};
    bool against_winding = false;  ///< the viewer is there
    double offset = 0.0;           ///< see SurfacePoint::offset
  };
  [[nodiscard]] PlanePoint plane_point(const WorldTriangle& triangle, const glm::dvec3& origin,
                                       const glm::dvec3& direction) const;
  [[nodiscard]] std::uint8_t layer_of(const WorldTriangle& triangle, bool inside) const;
  [[nodiscard]] double offset_of(const WorldTriangle& triangle) const;
  static void lift(const WorldTriangle& triangle, const Weights& weights, double side, SurfacePoint& point);
  void add_tangents(const WorldTriangle& triangle, const Weights& weights, SurfacePoint& point) const;

  const Scene& scene_;
  RaySpace space_;
  bool lifts_;
  RayForwarding* others_;
  std::vector<Placed> placed_;
  std::vector<std::vector<std::uint32_t>> parts_;  ///< [mesh][triangle]; empty but for those that cover in part
};

/// The triangles met last: neighbouring pixels, and the samples of a pixel, meet the same ones again.
class RecentTriangles {
 public:
  [[nodiscard]] const WorldTriangle& load(const Surfaces& surfaces, std::uint32_t id) {
    WorldTriangle& recent = triangles_[id % kPlaces];
    if (recent.surface == id) return recent;
    recent.instance = instance_;
    surfaces.load(id, recent);
    instance_ = recent.instance;
    return recent;
  }

 private:
  static constexpr std::size_t kPlaces = 512;
  std::vector<WorldTriangle> triangles_ = std::vector<WorldTriangle>(kPlaces);
  std::uint32_t instance_ = 0;  ///< of the last one loaded, which the next mostly shares
};

/// Which part of its mesh each triangle belongs to: triangles are of one part that share a place, by whatever vertices.
/// Numbers from 0, in the order of each part's first triangle. O(n log n).
[[nodiscard]] std::vector<std::uint32_t> parts_of(const Mesh& mesh);

/// Whether points of such surfaces have tangents.
[[nodiscard]] bool needs_tangents(const Material& material);
/// The texture by whose coordinates tangents go where the mesh has none; maybe not present.
[[nodiscard]] const TextureRef& map_of_tangents(const Material& material);

/// Barycentric coordinates moved onto the triangle; its middle where they are undefined (a triangle seen edge-on).
[[nodiscard]] inline glm::dvec2 onto_triangle(double u, double v) {
  if (!std::isfinite(u) || !std::isfinite(v)) return glm::dvec2(1.0 / 3.0);
  u = std::max(u, 0.0);
  v = std::max(v, 0.0);
  const double sum = std::max(u + v, 1.0);
  return {u / sum, v / sum};
}

}  // namespace hpr
