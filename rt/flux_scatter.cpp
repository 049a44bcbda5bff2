#include "rt/flux_scatter.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace hpr {
namespace {

/// Veach 1997, section 5.3.2: the cosines that flux and radiance are not agreed on.
double cosines(const SurfacePoint& surface, const glm::dvec3& shading_normal, const glm::dvec3& direction) {
  const glm::dvec3& geometric = surface.geometric_normal;
  const glm::dvec3& from = surface.to_viewer;
  return std::abs(glm::dot(direction, geometric) * glm::dot(from, shading_normal) /
                  (glm::dot(direction, shading_normal) * glm::dot(from, geometric)));
}

/// How often a glossy lobe's direction is chosen about the true surface's normal: as far as the shading normal leans,
/// as little lies beyond its horizon; half the time where most of the lobe may.
double chance_of_plain(const SurfacePoint& surface, const glm::dvec3& shading_normal) {
  const glm::dvec3& geometric = surface.geometric_normal;
  const glm::dvec3 mirrored = 2.0 * glm::dot(surface.to_viewer, geometric) * geometric - surface.to_viewer;
  if (!(glm::dot(mirrored, shading_normal) > 0.0)) return 0.5;
  return std::clamp(1.0 - glm::dot(shading_normal, geometric), 0.0, 0.5);
}

/// f times its cosine, as an eye in `direction` has it for light from `surface.to_viewer`, brought to flux: 1/sr.
glm::dvec3 scattered(const Scene& scene, const FluxArrival& at, Lobe lobe, const glm::dvec3& direction) {
  SurfacePoint seen = at.surface;
  seen.to_viewer = direction;
  const glm::dvec3 normal = normal_to_shade_with(scene, seen);
  const glm::dvec3& light = at.surface.to_viewer;
  const glm::dvec3& geometric = at.surface.geometric_normal;
  const double falls = glm::dot(light, geometric);
  if (!(falls > 0.0)) return glm::dvec3(0.0);
  return at.bsdf.seen_from(direction, normal).value(lobe, light) *
         (std::abs(glm::dot(light, normal)) * glm::dot(direction, geometric) / falls);
}

}  // namespace

std::optional<BsdfSample> sample_flux(const Scene& scene, const FluxArrival& at, Lobe lobe, Sampler& sampler) {
  const SurfacePoint& surface = at.surface;
  const glm::dvec3& normal = at.material.normal;
  const bool flat = surface.shading_normal == surface.geometric_normal && surface.tangent == glm::dvec3(0.0);
  if (flat) return at.bsdf.sample(lobe, sampler.two());
  if (lobe == Lobe::Transmission || at.bsdf.is_delta(lobe)) {
    std::optional<BsdfSample> sample = at.bsdf.sample(lobe, sampler.two());
    if (sample) sample->weight *= cosines(surface, normal, sample->direction);
    return sample;
  }
  // About the true surface a diffuse lobe is as wide as all that is ever seen of it.
  const double plain_chance = lobe == Lobe::Diffuse ? 1.0 : chance_of_plain(surface, normal);
  const Bsdf plain = at.bsdf.seen_from(surface.to_viewer, surface.geometric_normal);
  const bool by_plain = plain_chance == 1.0 || sampler.one() < plain_chance;
  std::optional<BsdfSample> sample = (by_plain ? plain : at.bsdf).sample(lobe, sampler.two());
  if (!sample) return sample;
  sample->pdf = plain_chance * plain.pdf(lobe, sample->direction);
  if (plain_chance < 1.0) sample->pdf += (1.0 - plain_chance) * at.bsdf.pdf(lobe, sample->direction);
  if (!(sample->pdf > 0.0)) return std::nullopt;
  sample->weight = scattered(scene, at, lobe, sample->direction) / sample->pdf;
  return sample;
}

}  // namespace hpr
