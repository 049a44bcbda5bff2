#include "rt/photon_gather.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "rt/photon_reflection.h"

namespace hpr {

bool is_followed(const Bsdf& bsdf, Lobe lobe, double glossy_cutoff) {
  if (lobe == Lobe::Transmission) return true;
  return lobe == Lobe::Reflection && (bsdf.roughness() < glossy_cutoff || bsdf.is_delta(lobe));
}

bool takes_photons(const Bsdf& bsdf, double glossy_cutoff) {
  return std::ranges::any_of(kLobes,
                             [&](Lobe lobe) { return !is_followed(bsdf, lobe, glossy_cutoff) && bsdf.present(lobe); });
}

glm::dvec3 gather_photons(const PhotonMap& map, const SurfacePoint& surface, const Bsdf& bsdf,
                          const glm::dvec3& shading_normal, double glossy_cutoff) {
  if (map.size() == 0) return glm::dvec3(0.0);
  // Transmission is always followed, so photons count on the viewer's side alone.
  const auto gathers = [&](Lobe lobe) { return !is_followed(bsdf, lobe, glossy_cutoff) && bsdf.present(lobe); };
  const bool diffuse = gathers(Lobe::Diffuse);
  const bool specular = gathers(Lobe::Reflection);
  if (!diffuse && !specular) return glm::dvec3(0.0);
  const bool flat = shading_normal == surface.geometric_normal;
  const ReflectionTerms terms = bsdf.reflection_terms(diffuse, specular);
  FoundPhotons found;
  glm::dvec3 light(0.0);
  map.visit(surface.position, surface.geometric_normal, [&](const Photon& photon, double weight) {
    const std::size_t i = found.count++;
    found.direction[i] = photon.direction;
    found.weight[i] = static_cast<float>(weight);
    for (std::size_t c = 0; c < 3; ++c) found.flux[c][i] = photon.flux[c];
    if (found.count < FoundPhotons::kMost) return;
    light += reflect_photons(terms, !flat, found);
    found.count = 0;
  });
  if (found.count > 0) light += reflect_photons(terms, !flat, found);
  light *= map.density();
  const double sum = light.r + light.g + light.b;
  return std::isfinite(sum) ? light : glm::dvec3(0.0);
}

}  // namespace hpr
