#pragma once

#include <glm/vec3.hpp>

namespace hpr {

/// What a film on a base reflects, 0 to 1 per channel: Belcour and Barla, "A Practical Extension to Microfacet Theory
/// for the Modeling of Varying Iridescence", 2017, as KHR_materials_iridescence simplifies it (Schlick's term at the
/// base, two interferences after the mean), but for Fresnel's equations at the film's own face: so a film of 0 nm is
/// not seen at any angle. The light comes in air, `cosine` off the normal, onto a film of index `ior` that is `nm`
/// thick, on a base that alone reflects `base_f0` looked at straight.
[[nodiscard]] glm::dvec3 thin_film_fresnel(double cosine, double ior, double nm, const glm::dvec3& base_f0);

}  // namespace hpr
