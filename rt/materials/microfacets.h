#pragma once

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "rt/sampling/sampling.h"

/// What all microfacet lobes are made of.
namespace hpr {

[[nodiscard]] constexpr double squared(double x) {
  return x * x;
}

/// The share of a view's cosine that the sphere of directions is cut below, so that few facets that it shows mirror it
/// into the surface: Eto and Tokuyoshi, "Bounded VNDF Sampling for Smith-GGX Reflections", 2023, equation 5.
[[nodiscard]] inline double mirrored_bound(double normal_view, double alpha2) {
  const double reach2 = squared(1.0 + std::sqrt(std::max(0.0, 1.0 - squared(normal_view))));
  return (1.0 - alpha2) * reach2 / (reach2 + alpha2 * squared(normal_view));
}

/// A normal of GGX facets of these alphas along x and y that `view` sees, both around z: Dupuy and Benyoub, "Sampling
/// Visible GGX Normals with Spherical Caps", 2023. The view, stretched with the facets, is half of the normal and a
/// direction of the sphere's cap, of which `bound` is the depth in its own cosines: `fraction` of it down, `around` on
/// its circle.
[[nodiscard]] inline glm::dvec3 visible_normal(const glm::dvec3& view, const glm::dvec2& alpha, double bound,
                                               double fraction, const glm::dvec2& around) {
  const glm::dvec3 stretched = glm::normalize(glm::dvec3(alpha.x * view.x, alpha.y * view.y, view.z));
  const double depth = bound * stretched.z;
  const double z = 1.0 - fraction * (1.0 + depth);
  const glm::dvec2 across = std::sqrt(std::max(0.0, 1.0 - z * z)) * around;
  const glm::dvec3 sum(across.x + stretched.x, across.y + stretched.y, z + stretched.z);
  const glm::dvec3 normal(alpha.x * sum.x, alpha.y * sum.y, std::max(0.0, sum.z));
  const double length = glm::length(normal);
  return length > 0.0 ? normal / length : glm::dvec3(0.0, 0.0, 1.0);
}

/// Fresnel's equations for unpolarised light that comes in `cosine` off the normal from a medium of index 1 to one of
/// index `eta` (Born and Wolf, Principles of Optics, section 1.5). 1 where nothing gets through.
[[nodiscard]] inline double fresnel_exact(double cosine, double eta) {
  const double sine2 = (1.0 - cosine * cosine) / (eta * eta);
  if (!(sine2 < 1.0)) return 1.0;
  const double refracted = std::sqrt(1.0 - sine2);
  const double parallel = (eta * cosine - refracted) / (eta * cosine + refracted);
  const double perpendicular = (cosine - eta * refracted) / (cosine + eta * refracted);
  return 0.5 * (squared(parallel) + squared(perpendicular));
}

/// The share of even light from all sides that enters a medium of a higher index, relative to its own: 1 less the mean
/// of fresnel_exact over the projected hemisphere (Egan and Hilgeman, "Optical Properties of Inhomogeneous Materials",
/// 1979, appendix). Below 1.01, where the closed form loses its digits, less than 0.0032 is reflected: none is.
[[nodiscard]] inline double entering(double index) {
  if (!(index > 1.01)) return 1.0;
  const double n = std::min(index, 1e4);
  const double n2 = squared(n);
  const double n4 = squared(n2);
  const double reflected = 0.5 + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * squared(n + 1.0)) +
                           n2 * squared((n2 - 1.0) / (n2 + 1.0)) / (n2 + 1.0) * std::log((n - 1.0) / (n + 1.0)) -
                           2.0 * n * n2 * (n2 + 2.0 * n - 1.0) / ((n2 + 1.0) * (n4 - 1.0)) +
                           8.0 * n4 * (n4 + 1.0) / ((n2 + 1.0) * squared(n4 - 1.0)) * std::log(n);
  return 1.0 - reflected;
}

}  // namespace hpr
