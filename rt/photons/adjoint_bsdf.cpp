#include "rt/photons/adjoint_bsdf.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace hpr {
namespace {

/// How far rounding takes two normals apart that are one.
constexpr double kSame = 1e-6;

double sum_of(const glm::dvec3& v) {
  return v.r + v.g + v.b;
}

/// How often a glossy lobe's direction is chosen about the true surface's normal: as far as the shading normal leans,
/// as little lies beyond its horizon; more where much of the lobe may.
double chance_of_plain(const SurfacePoint& surface, const glm::dvec3& shading_normal, Lobe lobe) {
  // About the true surface a diffuse lobe is as wide as all that is ever seen of it.
  if (lobe == Lobe::Diffuse) return 1.0;
  if (lobe == Lobe::Transmission) return 0.25;
  if (lobe == Lobe::DiffuseTransmission) return 1.0;
  const glm::dvec3& geometric = surface.geometric_normal;
  const glm::dvec3 reflected = 2.0 * glm::dot(surface.to_viewer, geometric) * geometric - surface.to_viewer;
  if (!(glm::dot(reflected, shading_normal) > 0.0)) return 0.5;
  return std::clamp(1.0 - glm::dot(shading_normal, geometric), 0.0, 0.5);
}

/// Where an eye's ray came from that a mirror of `normal` sent along `arrived`, or, with an index, a surface bent so.
std::optional<glm::dvec3> sent_from(const glm::dvec3& arrived, const glm::dvec3& normal, std::optional<double> eta) {
  const double cosine = glm::dot(arrived, normal);
  if (!(cosine > 0.0)) return std::nullopt;
  if (!eta) return glm::normalize(2.0 * cosine * normal - arrived);
  const double sine2 = std::max(0.0, 1.0 - cosine * cosine) / (*eta * *eta);
  if (!(sine2 < 1.0)) return std::nullopt;
  return glm::normalize((cosine / *eta - std::sqrt(1.0 - sine2)) * normal - arrived / *eta);
}

}  // namespace

AdjointBsdf::AdjointBsdf(const Scene& scene, const Surfaces& surfaces, const FluxArrival& at)
    : scene_(scene),
      surfaces_(surfaces),
      at_(at),
      flat_(at.surface.shading_normal == at.surface.geometric_normal && at.surface.tangent == glm::dvec3(0.0)) {
  if (flat_) return;
  plain_ = at.bsdf.seen_from(at.surface.to_viewer, at.surface.geometric_normal);
  for (const Lobe lobe : {Lobe::Reflection, Lobe::Transmission}) {
    if (at.bsdf.present(lobe) && at.bsdf.is_delta(lobe) && !is_plain(lobe)) {
      directions_[lobe == Lobe::Transmission ? 1 : 0] = find_directions(lobe);
    }
  }
  if (at.bsdf.is_extended() && at.bsdf.is_delta(Lobe::Coat)) {
    coat_directions_ =
        std::make_unique<const Directions>(at.bsdf.present(Lobe::Coat) ? find_directions(Lobe::Coat) : Directions{});
  }
}

/// What passes a clear sheet goes straight on, whatever its normal.
bool AdjointBsdf::is_plain(Lobe lobe) const {
  const bool bends = at_.material.solid && at_.material.ior != 1.0;
  return flat_ || (lobe == Lobe::Transmission && at_.bsdf.is_delta(lobe) && !bends);
}

glm::dvec3 AdjointBsdf::weight(Lobe lobe) const {
  if (is_plain(lobe)) return at_.bsdf.weight(lobe);
  if (at_.bsdf.is_delta(lobe)) return directions(lobe).sum;
  return 0.5 * (at_.bsdf.weight(lobe) + plain_.weight(lobe));
}

double AdjointBsdf::gain() const {
  if (flat_) return 1.0;
  const glm::dvec3& light = at_.surface.to_viewer;
  const double falls = glm::dot(light, at_.surface.geometric_normal);
  const double caught = std::max(glm::dot(light, at_.material.normal), glm::dot(light, at_.surface.shading_normal));
  return falls > 0.0 && caught > falls ? caught / falls : 1.0;
}

std::optional<BsdfSample> AdjointBsdf::sample(Lobe lobe, Sampler& sampler) const {
  if (is_plain(lobe)) return at_.bsdf.sample(lobe, sampler.two());
  return at_.bsdf.is_delta(lobe) ? sample_direction(directions(lobe), sampler) : sample_wide(lobe, sampler);
}

/// The place as an eye in `direction` meets it.
SurfacePoint AdjointBsdf::seen_from(const glm::dvec3& direction) const {
  if (glm::dot(direction, at_.surface.geometric_normal) < 0.0) {
    return surfaces_.meet(at_.triangle, at_.surface.position, -direction);
  }
  SurfacePoint seen = at_.surface;
  seen.to_viewer = direction;
  return seen;
}

/// The material as an eye sees it, of the channel of light that was chosen here.
MaterialPoint AdjointBsdf::material_at(const SurfacePoint& seen) const {
  MaterialPoint material = evaluate_material(scene_, seen);
  material.channel = at_.material.channel;
  material.channel_scale = at_.material.channel_scale;
  material.ior = at_.material.ior;
  return material;
}

/// The normal that an eye shades a lobe with.
glm::dvec3 AdjointBsdf::normal_of(Lobe lobe, const SurfacePoint& seen) const {
  return lobe == Lobe::Coat ? coat_normal_to_shade_with(scene_, seen) : normal_to_shade_with(scene_, seen);
}

/// f times its cosine, as an eye in `direction` has it for light from `surface.to_viewer`, brought to flux: 1/sr.
glm::dvec3 AdjointBsdf::scattered(Lobe lobe, const glm::dvec3& direction) const {
  const glm::dvec3& light = at_.surface.to_viewer;
  const glm::dvec3& geometric = at_.surface.geometric_normal;
  const double falls = glm::dot(light, geometric);
  if (!(falls > 0.0)) return glm::dvec3(0.0);
  const double leaves = std::abs(glm::dot(direction, geometric)) / falls;
  const SurfacePoint seen = seen_from(direction);
  if (lobe == Lobe::Transmission || at_.bsdf.is_extended()) {
    const MaterialPoint material = material_at(seen);
    return Bsdf(material, seen).value(lobe, light) * (std::abs(glm::dot(light, material.normal)) * leaves);
  }
  const glm::dvec3 normal = normal_to_shade_with(scene_, seen);
  return at_.bsdf.seen_from(direction, normal).value(lobe, light) * (std::abs(glm::dot(light, normal)) * leaves);
}

std::optional<BsdfSample> AdjointBsdf::sample_wide(Lobe lobe, Sampler& sampler) const {
  const double plain_chance = chance_of_plain(at_.surface, at_.material.normal, lobe);
  const bool by_plain = plain_chance == 1.0 || sampler.one() < plain_chance;
  std::optional<BsdfSample> sample = (by_plain ? plain_ : at_.bsdf).sample(lobe, sampler.two());
  if (!sample) return sample;
  sample->pdf = plain_chance * plain_.pdf(lobe, sample->direction);
  if (plain_chance < 1.0) sample->pdf += (1.0 - plain_chance) * at_.bsdf.pdf(lobe, sample->direction);
  if (!(sample->pdf > 0.0)) return std::nullopt;
  sample->weight = scattered(lobe, sample->direction) / sample->pdf;
  return sample;
}

/// The way by one normal, for light that arrives as it is, or as it was before an eye's ray was put back on its side.
FluxDirection AdjointBsdf::direction_by(Lobe lobe, const glm::dvec3& arrived, const glm::dvec3& normal,
                                        std::optional<double> eta) const {
  const glm::dvec3& geometric = at_.surface.geometric_normal;
  const double falls = glm::dot(at_.surface.to_viewer, geometric);
  const std::optional<glm::dvec3> direction = sent_from(arrived, normal, eta);
  if (!direction || !(falls > 0.0)) return {};
  const double leaves = glm::dot(*direction, geometric);
  if (eta ? !(leaves < 0.0) : !(leaves > 0.0)) return {};
  const SurfacePoint seen = seen_from(*direction);
  const glm::dvec3 facing = eta ? -normal : normal;
  if (glm::distance(normal_of(lobe, seen), facing) > kSame) return {};
  const Bsdf bsdf(material_at(seen), seen, Carried::Flux);
  const double squeezed = glm::dot(arrived, normal) / std::abs(glm::dot(*direction, normal));
  return {*direction, bsdf.weight(lobe) * (squeezed * std::abs(leaves) / falls)};
}

AdjointBsdf::Directions AdjointBsdf::find_directions(Lobe lobe) const {
  const SurfacePoint& surface = at_.surface;
  const glm::dvec3& light = surface.to_viewer;
  const glm::dvec3& geometric = surface.geometric_normal;
  std::optional<double> eta;
  if (lobe == Lobe::Transmission) eta = surface.inside ? 1.0 / at_.material.ior : at_.material.ior;
  // Those an eye may shade with: by the map, by the corners, by the triangle.
  const glm::dvec3& own = lobe == Lobe::Coat ? at_.material.extensions->clearcoat_normal : at_.material.normal;
  const std::array<glm::dvec3, 4> normals{own, normal_of(lobe, seen_from(geometric)), surface.shading_normal,
                                          geometric};
  const std::array<glm::dvec3, 2> arrived{light, light - 2.0 * glm::dot(light, geometric) * geometric};
  Directions directions;
  for (auto normal = normals.begin(); normal != normals.end(); ++normal) {
    const auto same = [&](const glm::dvec3& other) { return glm::distance(other, *normal) < 4.0 * kSame; };
    if (std::any_of(normals.begin(), normal, same)) continue;
    for (const glm::dvec3& before : arrived) {
      const FluxDirection direction = direction_by(lobe, before, *normal, eta);
      if (!(sum_of(direction.weight) > 0.0) || !std::isfinite(sum_of(direction.weight))) continue;
      directions.sum += direction.weight;
      directions.all.at(directions.count++) = direction;
    }
  }
  return directions;
}

std::optional<BsdfSample> AdjointBsdf::sample_direction(const Directions& directions, Sampler& sampler) const {
  if (directions.count == 0) return std::nullopt;
  const double sum = sum_of(directions.sum);
  double left = directions.count == 1 ? 0.0 : sampler.one() * sum;
  std::size_t chosen = 0;
  while (chosen + 1 < directions.count && left >= sum_of(directions.all.at(chosen).weight)) {
    left -= sum_of(directions.all.at(chosen++).weight);
  }
  const FluxDirection& direction = directions.all.at(chosen);
  return BsdfSample{direction.direction, direction.weight * (sum / sum_of(direction.weight)), 0.0};
}

}  // namespace hpr
