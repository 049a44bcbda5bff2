#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "rt/trace/ray_scene.h"
#include "scene/scene.h"

namespace hpr {

/// Of each instance, whether its triangles are refined on their way into Embree. Floats hold the corners of a tilted
/// ground of 1000 km to a decimeter, and its plane is no better near ray space's origin, where all the other objects
/// may be. On a level one the plane is exact, but Embree's edge test is off by as much: beside the edge that two
/// triangles share, rays meet the wrong one. So edges longer than their distance from that origin are halved in double,
/// and their halves, until none is: the parts about a place have corners that are rounded about as finely as the place
/// itself. Whether an edge is halved depends on its ends alone, so triangles that share it stay closed.
///
/// Those instances are refined that have a triangle of which that moves the plane a hundred times less or better, or
/// one with an edge a thousand times as long as it is far away; in the order of instances, while a quarter of a million
/// parts are left. They have triangles of their own, whatever shared_instances says. Depends on nothing but scene and
/// space.
[[nodiscard]] std::vector<std::uint8_t> refined_instances(const Scene& scene, const RaySpace& space);

/// Where ranks hold parts of meshes, what one of them finds out about an instance: how many parts its triangles have
/// that are divided, and how often that is worth it.
struct RefinementCount {
  std::uint32_t instance = 0;
  std::uint32_t is_worth_it = 0;
  std::uint64_t parts = 0;
};
/// Those of the surfaces of `part`, which are here.
[[nodiscard]] std::vector<RefinementCount> count_refined_parts(const Scene& scene, const RaySpace& space,
                                                               std::span<const SurfaceRange> part);
/// refined_instances() by what all ranks counted, each of its own part.
[[nodiscard]] std::vector<std::uint8_t> refined_by_counts(const Scene& scene, std::span<const RefinementCount> counts);

/// Metres by which ray origins must leave a refined triangle at a place of it.
[[nodiscard]] double refined_offset(const RaySpace& space, const glm::dvec3& position);

/// A triangle and a ray that meets its plane: metres, relative to ray space's origin.
struct RayOnTriangle {
  glm::dvec3 v0{0.0};
  glm::dvec3 e1{0.0};
  glm::dvec3 e2{0.0};
  glm::dvec3 ray_origin{0.0};
  glm::dvec3 direction{0.0};
};

/// Of a refined triangle: barycentric coordinates `at` of where a ray meets its plane, moved onto the triangle as far
/// as they lie farther off than Embree's rounding puts a ray that it found to meet the triangle. So beside an edge a
/// ray meets the plane where it does, not the edge; the neighbor may lie in that plane too.
[[nodiscard]] glm::dvec2 onto_refined(const RaySpace& space, const glm::dvec2& at, const RayOnTriangle& from);

/// What the rounding of corners to floats, and of the products that make a normal of them, moves a ray's meeting with a
/// triangle by along its normal, in float steps and in the unit of its coordinates: as Waechter and Binder ("A Fast and
/// Robust Method for Avoiding Self-Intersection", Ray Tracing Gems, chapter 6) take it from a place's coordinates, but
/// by axis. `corners` is the largest coordinate of a corner, by axis.
[[nodiscard]] double plane_rounding(const glm::dvec3& e1, const glm::dvec3& e2, const glm::dvec3& normal,
                                    const glm::dvec3& corners);

/// Triangles in parts.
struct RefinedTriangles {
  std::vector<std::array<glm::dvec3, 3>> parts;  ///< ray space
  std::vector<std::uint32_t> triangle_of;        ///< of each part, counted from the first of the range
};

/// Those of an instance that is refined, `triangles` of its mesh.
[[nodiscard]] RefinedTriangles refine(const Scene& scene, const Instance& instance, SurfaceRange triangles,
                                      const RaySpace& space);

}  // namespace hpr
