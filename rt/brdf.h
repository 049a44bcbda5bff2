#pragma once

#include <array>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "scene/scene.h"

namespace hpr {

/// How a surface scatters light at one place: glTF 2.0, appendix B. A dielectric base (Lambert under a specular layer)
/// mixed with a metal; GGX distribution (Walter, Marschner, Li, Torrance 2007) with alpha = roughness^2,
/// height-correlated Smith shadowing (Heitz 2014), Schlick's Fresnel term. As the specification has it, a white
/// dielectric reflects up to 1.3 times what arrives towards grazing viewers and 1.05 times in the mean; metals never
/// exceed 1.
struct Brdf {
  glm::dvec3 base_color{1.0};
  double metallic = 0.0;
  double roughness = 1.0;
  double transmission = 0.0;  ///< share of the base's diffuse light that is let through instead
  double dielectric_f0 = 0.04;

  /// f(to_light, to_viewer) in 1/sr; both of unit length and on the normal's side, else 0. Symmetric in its directions,
  /// never negative, never NaN. A perfectly smooth surface (see `is_delta`) shows only its diffuse part: its mirror
  /// lobe has no value, only a direction.
  [[nodiscard]] glm::dvec3 value(const glm::dvec3& normal, const glm::dvec3& to_light,
                                 const glm::dvec3& to_viewer) const;

  /// What the specular layer reflects of light that comes in `cosine` off the normal of its facets.
  [[nodiscard]] glm::dvec3 fresnel(double cosine) const;

  [[nodiscard]] bool is_delta() const { return roughness < kDeltaRoughness; }

  /// Below it the lobe is narrower than 1e-6 rad and counts as a mirror.
  static constexpr double kDeltaRoughness = 1e-3;
};

/// A material where a surface was met.
struct MaterialPoint {
  Brdf brdf;
  glm::dvec3 emission{0.0};  ///< radiance
};

/// The material with its textures read at the surface's texture coordinates.
[[nodiscard]] MaterialPoint evaluate_material(const Scene& scene, const Material& material,
                                              const std::array<glm::vec2, 2>& uv);

}  // namespace hpr
