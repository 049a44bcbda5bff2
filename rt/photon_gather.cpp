#include "rt/photon_gather.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

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
  const glm::dvec3 light = map.gather(surface.position, surface.geometric_normal, [&](const glm::dvec3& from) {
    const glm::dvec3 value = bsdf.reflected(from, diffuse, specular);
    if (flat) return value;
    // Photons fall on the true surface, light is to fall on the one the shading normal pretends.
    constexpr double kGrazing = 1e-3;
    const double falls = std::abs(glm::dot(from, surface.geometric_normal));
    return value * (std::abs(glm::dot(from, shading_normal)) / std::max(falls, kGrazing));
  });
  const double sum = light.r + light.g + light.b;
  return std::isfinite(sum) ? light : glm::dvec3(0.0);
}

}  // namespace hpr
