#include "rt/photons/photon_gather.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "rt/photons/photon_reflection.h"

namespace hpr {

bool is_followed(const Bsdf& bsdf, Lobe lobe, double glossy_cutoff) {
  if (lobe == Lobe::Transmission) return true;
  return lobe == Lobe::Reflection && (bsdf.roughness() < glossy_cutoff || bsdf.is_delta(lobe));
}

bool follows_reflections(const Requirements& scene, double glossy_cutoff) {
  return scene.min_roughness < std::max(glossy_cutoff, Bsdf::kDeltaRoughness);
}

bool may_take_photons(const Requirements& scene, double glossy_cutoff) {
  return scene.ambient_occlusion.needed || scene.max_roughness >= std::max(glossy_cutoff, Bsdf::kDeltaRoughness);
}

bool takes_photons(const Bsdf& bsdf, double glossy_cutoff) {
  return std::ranges::any_of(kLobes,
                             [&](Lobe lobe) { return !is_followed(bsdf, lobe, glossy_cutoff) && bsdf.present(lobe); });
}

glm::dvec3 gather_photons(const PhotonMap& map, const SurfacePoint& surface, const Bsdf& bsdf,
                          const glm::dvec3& shading_normal, double glossy_cutoff, FoundPhotons& found) {
  if (map.size() == 0) return glm::dvec3(0.0);
  // Transmission is always followed, so photons count on the viewer's side alone.
  const auto gathers = [&](Lobe lobe) { return !is_followed(bsdf, lobe, glossy_cutoff) && bsdf.present(lobe); };
  const bool diffuse = gathers(Lobe::Diffuse);
  const bool specular = gathers(Lobe::Reflection);
  if (!diffuse && !specular) return glm::dvec3(0.0);
  map.find(surface.position, surface.geometric_normal, surface.layer, found);
  if (found.count == 0) return glm::dvec3(0.0);
  const bool leans = shading_normal != surface.geometric_normal;
  const ReflectionTerms terms = bsdf.reflection_terms(diffuse, specular);
  const glm::dvec3 light = map.density() * reflect_photons(terms, leans, map.lights(), found);
  const double sum = light.r + light.g + light.b;
  return std::isfinite(sum) ? light : glm::dvec3(0.0);
}

}  // namespace hpr
