#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>

namespace hpr {

/// White facets of a GGX distribution that is wider along one tangent than across it (Burley, "Physically-Based Shading
/// at Disney", 2012; height-correlated Smith shadowing, Heitz 2014), looked at from one side. All directions point away
/// from the surface and have unit length; lights lie on the normal's side.
class AnisotropicFacets {
 public:
  /// GGX alphas `along` and `across` the `tangent`, which is at right angles to `normal`; both above 0.
  AnisotropicFacets(const glm::dvec3& view, const glm::dvec3& normal, const glm::dvec3& tangent, double along,
                    double across);

  /// f, less Fresnel's term: 1/sr.
  [[nodiscard]] double value(const glm::dvec3& to_light) const;
  /// Of sample(), per solid angle.
  [[nodiscard]] double pdf(const glm::dvec3& to_light) const;
  /// By visible normals, less those that mirror into the surface (Eto and Tokuyoshi 2023). None below the surface.
  [[nodiscard]] std::optional<glm::dvec3> sample(const glm::dvec2& u) const;

 private:
  [[nodiscard]] double distribution(const glm::dvec3& half) const;
  [[nodiscard]] double stretched(const glm::dvec3& local) const;

  glm::dmat3 frame_;  ///< tangent, across it, normal
  glm::dvec3 view_;   ///< in that frame
  double along_;
  double across_;
  double view_stretched_;
  double bound_;
};

}  // namespace hpr
