#pragma once

#include <array>
#include <cstdint>
#include <glm/exponential.hpp>
#include <glm/geometric.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "rt/materials/material_point.h"
#include "rt/trace/surfaces.h"
#include "scene/scene.h"
#include "scene/view.h"

/// What solids absorb (KHR_materials_volume): a stretch of d metres through one leaves exp(-absorption d), wherever it
/// begins and ends. Solids may lie in one another, two deep: a place belongs to the innermost. Solids that overlap
/// otherwise hold only as far as stretches end on their own walls.
namespace hpr {

/// What a place lies in, 1/m; zero: nothing that absorbs.
struct Media {
  glm::dvec3 here{0.0};    ///< absorption of the innermost solid
  glm::dvec3 around{0.0};  ///< absorption of the solid that encloses that

  bool operator==(const Media&) const = default;
};

/// The transmittance of `metres` of a medium: the fraction of light that is not absorbed.
[[nodiscard]] inline glm::dvec3 transmittance(const glm::dvec3& absorption, double metres) {
  return absorption == glm::dvec3(0.0) ? glm::dvec3(1.0) : glm::exp(-absorption * metres);
}

/// The transmittance of a stretch of `metres` that came through `media` and ends at `point`. Where that is the
/// inside of a solid's wall, the solid itself says what it was. Not for the eye's first stretch: that is in what the
/// eye is in, as at a silhouette a pixel may show the wall behind.
[[nodiscard]] inline glm::dvec3 transmittance_to(const Media& media, const SurfacePoint& point,
                                                 const MaterialPoint& material, double metres) {
  return transmittance(point.inside && material.solid ? material.absorption : media.here, metres);
}

/// What lies on the side of `point` that `direction` leads to, for who came to it through `media`.
[[nodiscard]] inline Media media_towards(const Media& media, const SurfacePoint& point, const MaterialPoint& material,
                                         const glm::dvec3& direction) {
  if (!material.solid) return media;
  const bool back = glm::dot(direction, point.geometric_normal) > 0.0;
  if (point.inside) return back ? Media{material.absorption, media.around} : Media{media.around, {}};
  return back ? media : Media{material.absorption, media.here};
}

/// Whether `direction` leads from `point` into the solid it bounds, by refraction or by reflection from within.
[[nodiscard]] inline bool leads_into_solid(const SurfacePoint& point, const MaterialPoint& material,
                                           const glm::dvec3& direction) {
  return material.solid && (glm::dot(direction, point.geometric_normal) > 0.0) == point.inside;
}

/// The transmittance from a light `metres` away to `point`. Infinite distances count as 1: what
/// they lead through has no far wall, or their shadow rays find it.
[[nodiscard]] glm::dvec3 transmittance_to_light(const Media& media, const SurfacePoint& point,
                                                const MaterialPoint& material, const glm::dvec3& to_light,
                                                double metres);

/// Finds the solids places lie in. Costs nothing in scenes without a solid that absorbs, and elsewhere little where a
/// place is outside of their boxes; else a test of every triangle of the instances whose boxes a line meets.
class MediumFinder {
 public:
  /// The scene must outlive this.
  explicit MediumFinder(const Scene& scene);

  /// Whether some solid of the scene absorbs.
  [[nodiscard]] bool absorbs() const { return !boxes_.empty(); }

  /// A place lies in a solid that a line through it leaves both ways without having entered it: so open meshes hold
  /// nothing. Exact up to double rounding, but for places on a wall.
  [[nodiscard]] Media at(const glm::dvec3& position) const;

  /// What the eye of each view lies in, looked for once where they share it. An orthographic view has no such place:
  /// its rays start in what absorbs nothing.
  [[nodiscard]] std::vector<Media> of_eyes(std::span<const View> views) const;

 private:
  struct Solid {
    std::uint32_t instance = 0;
    Bounds box;  ///< world
    glm::dmat4 from_world{1.0};
  };
  struct Crossing {
    double along = 0.0;  ///< of the line
    std::uint32_t material = 0;
    bool leaves = false;  ///< as seen by who goes up the line
  };

  void cross(const Solid& solid, const glm::dvec3& position, std::vector<Crossing>& crossings) const;

  const Scene& scene_;
  std::vector<Solid> solids_;
  std::vector<Bounds> boxes_;  ///< world, of all instances of each material that absorbs
};

}  // namespace hpr
