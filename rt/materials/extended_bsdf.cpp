#include "rt/materials/extended_bsdf.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>

#include "rt/materials/microfacets.h"
#include "rt/materials/sheen.h"
#include "rt/materials/thin_film.h"
#include "rt/sampling/sampling.h"

namespace hpr {
namespace {

/// As Bsdf's.
constexpr double kMinWeight = 1e-3;
constexpr double kEdgeOn = 1e-9;
/// Of the narrow side of anisotropic facets.
constexpr double kMinAlpha = 1e-4;
constexpr double kCoatIor = 1.5;

double largest(const glm::dvec3& v) {
  return std::max({v.x, v.y, v.z});
}

MaterialPoint without_extensions(const MaterialPoint& material) {
  MaterialPoint plain = material;
  plain.extensions.reset();
  return plain;
}

MaterialPoint white_metal(const MaterialPoint& material) {
  MaterialPoint metal;
  metal.metallic = 1.0;
  metal.roughness = material.roughness;
  metal.normal = material.normal;
  metal.unlit = material.unlit;
  return metal;
}

MaterialPoint coat_of(const ExtensionPoint& extensions) {
  MaterialPoint coat;
  coat.base_color = glm::dvec3(0.0);
  coat.ior = kCoatIor;
  coat.roughness = extensions.clearcoat_roughness;
  coat.normal = extensions.clearcoat_normal;
  return coat;
}

std::optional<AnisotropicFacets> anisotropic_facets(const MaterialPoint& material, const ExtensionPoint& extensions,
                                                    const glm::dvec3& view) {
  // Where light goes through too, by round facets, it is reflected by those: each takes what the other leaves.
  if (!(extensions.anisotropy > 0.0) || material.transmission > 0.0) return std::nullopt;
  // The direction lies in the plane of another normal where the viewer is another.
  const glm::dvec3& direction = extensions.anisotropy_direction;
  const glm::dvec3 tangent = direction - glm::dot(direction, material.normal) * material.normal;
  const double length = glm::length(tangent);
  if (!(length > 0.0)) return std::nullopt;
  const double across = std::max(squared(material.roughness), kMinAlpha);
  const double along = across + (1.0 - across) * squared(extensions.anisotropy);
  return AnisotropicFacets(view, material.normal, tangent / length, along, across);
}

}  // namespace

ExtendedBsdf::ExtendedBsdf(const MaterialPoint& material, const SurfacePoint& surface, Carried carried)
    : material_(without_extensions(material)),
      extensions_(*material.extensions),
      surface_(surface),
      carried_(carried),
      plain_(material_, surface, carried),
      facets_(white_metal(material), surface),
      coat_(coat_of(extensions_), surface),
      scatters_(facets_.present(Lobe::Reflection)) {
  const double base = (1.0 - material.metallic) * (1.0 - material.transmission);
  diffuse_ = base * (1.0 - extensions_.diffuse_transmission);
  through_ = base * extensions_.diffuse_transmission;
  f0_ = material.ior > 0.0 ? squared((material.ior - 1.0) / (material.ior + 1.0)) : 1.0;
  if (!scatters_) return;
  normal_view_ = std::min(normal_to(surface.to_viewer), 1.0);
  view_enters_ = enters(normal_view_);
  anisotropic_ = anisotropic_facets(material_, extensions_, surface.to_viewer);
  const double sheen = largest(extensions_.sheen_color) * sheen_albedo(extensions_.sheen_roughness, normal_view_);
  if (!(largest(extensions_.sheen_color) > 0.0)) return;
  sheen_.emplace(extensions_.sheen_roughness, normal_view_);
  view_below_sheen_ = 1.0 - sheen;
  const double under = diffuse_ * view_enters_ * largest(material.base_color) * (1.0 - sheen);
  sheen_chance_ = std::max(sheen, kMinWeight) / (std::max(sheen, kMinWeight) + under);
}

ExtendedBsdf ExtendedBsdf::seen_from(const glm::dvec3& to_viewer, const glm::dvec3& normal) const {
  SurfacePoint surface = surface_;
  surface.to_viewer = to_viewer;
  MaterialPoint material = material_;
  material.normal = normal;
  ExtensionPoint extensions = extensions_;
  extensions.clearcoat_normal = normal;
  material.extensions = std::make_shared<const ExtensionPoint>(extensions);
  return {material, surface, carried_};
}

double ExtendedBsdf::normal_to(const glm::dvec3& direction) const {
  return glm::dot(material_.normal, direction);
}

bool ExtendedBsdf::same_side(const glm::dvec3& to_light) const {
  return normal_to(to_light) > kEdgeOn && glm::dot(surface_.geometric_normal, to_light) > 0.0;
}

bool ExtendedBsdf::other_side(const glm::dvec3& to_light) const {
  return normal_to(to_light) < -kEdgeOn && glm::dot(surface_.geometric_normal, to_light) < 0.0;
}

/// Whether a direction leads into the solid that the surface bounds.
bool ExtendedBsdf::is_within(const glm::dvec3& direction) const {
  return material_.solid && (glm::dot(surface_.geometric_normal, direction) > 0.0) == surface_.inside;
}

double ExtendedBsdf::eta() const {
  return material_.solid && surface_.inside ? 1.0 / material_.ior : material_.ior;
}

/// The dielectric's term where Fresnel's, without extensions, is `plain`, on the side from which the index is `eta`.
glm::dvec3 ExtendedBsdf::dielectric(double cosine, double plain, double eta) const {
  // Where a volume reflects all, nothing on it changes that.
  if (is_exact() && plain >= 1.0) return glm::dvec3(1.0);
  const glm::dvec3 f0 = glm::min(f0_ * extensions_.specular_color, 1.0);
  glm::dvec3 term(0.0);
  if (material_.ior != 1.0) {
    const double rise = material_.ior > 0.0 ? (plain - f0_) / (1.0 - f0_) : schlick_rise(cosine);
    term = glm::max(extensions_.specular * (f0 + (1.0 - f0) * rise), 0.0);
  }
  if (!(extensions_.iridescence > 0.0)) return term;
  // Of light from within, what goes on in the air counts: so both ways are alike.
  const double in_air =
      is_exact() && eta < 1.0 ? std::sqrt(std::max(0.0, 1.0 - (1.0 - squared(cosine)) / squared(eta))) : cosine;
  const glm::dvec3 film =
      thin_film_fresnel(in_air, extensions_.iridescence_ior, extensions_.iridescence_nm, extensions_.specular * f0);
  return glm::mix(term, film, extensions_.iridescence);
}

glm::dvec3 ExtendedBsdf::dielectric(double cosine) const {
  return dielectric(cosine, plain_.dielectric_fresnel(cosine), eta());
}

/// Of the dielectric and the metal by their shares; `plain`: what the dielectric reflects without extensions.
glm::dvec3 ExtendedBsdf::fresnel(double cosine, double plain) const {
  glm::dvec3 term = (1.0 - material_.metallic) * dielectric(cosine, plain, eta());
  if (!(material_.metallic > 0.0)) return term;
  const glm::dvec3& color = material_.base_color;
  glm::dvec3 metal = color + (1.0 - color) * schlick_rise(cosine);
  if (extensions_.iridescence > 0.0) {
    metal = glm::mix(metal, thin_film_fresnel(cosine, extensions_.iridescence_ior, extensions_.iridescence_nm, color),
                     extensions_.iridescence);
  }
  return term + material_.metallic * metal;
}

glm::dvec3 ExtendedBsdf::fresnel(double cosine) const {
  return fresnel(cosine, plain_.dielectric_fresnel(cosine));
}

/// What the dielectric's reflection leaves to its base, in every channel.
double ExtendedBsdf::enters(double cosine) const {
  return 1.0 - largest(dielectric(cosine));
}

/// The mean of enters() over an even sky, from outside, of surfaces by Fresnel's equations; 1 where a film makes it
/// depend on the angle otherwise.
double ExtendedBsdf::mean_entering() const {
  if (extensions_.iridescence > 0.0 || material_.ior == 1.0) return 1.0;
  const double f0 = std::min(f0_ * largest(extensions_.specular_color), 1.0);
  const double reflected = 1.0 - entering(material_.ior);
  return 1.0 - extensions_.specular * (f0 + (1.0 - f0) * (reflected - f0_) / (1.0 - f0_));
}

/// About the share of light that the base is reached by towards the viewer, for choosing among lobes.
double ExtendedBsdf::base_enters() const {
  return is_exact() ? view_enters_ / mean_entering() : std::max(enters(1.0), kMinWeight);
}

double ExtendedBsdf::below_coat(const glm::dvec3& direction) const {
  return is_within(direction) ? 1.0 : coat_transmittance(extensions_, direction);
}

double ExtendedBsdf::below_sheen(const glm::dvec3& direction) const {
  const double color = largest(extensions_.sheen_color);
  if (!(color > 0.0)) return 1.0;
  return 1.0 - color * sheen_albedo(extensions_.sheen_roughness, std::abs(normal_to(direction)));
}

double ExtendedBsdf::below_coat_both(const glm::dvec3& to_light) const {
  return std::min(below_coat(surface_.to_viewer), below_coat(to_light));
}

double ExtendedBsdf::below_both(const glm::dvec3& to_light) const {
  return below_coat_both(to_light) * std::min(view_below_sheen_, below_sheen(to_light));
}

/// What of light from there the specular layer leaves to the base, on the viewer's side.
double ExtendedBsdf::diffuse_enters(const glm::dvec3& to_light) const {
  if (is_exact()) return view_enters_ * enters(normal_to(to_light)) / mean_entering();
  return enters(0.5 * glm::length(surface_.to_viewer + to_light));
}

glm::dvec3 ExtendedBsdf::diffuse_value(const glm::dvec3& to_light) const {
  if (!scatters_ || !same_side(to_light)) return glm::dvec3(0.0);
  glm::dvec3 result(0.0);
  if (diffuse_ > 0.0) {
    const double under = std::min(view_below_sheen_, below_sheen(to_light));
    result = (diffuse_ * std::numbers::inv_pi * diffuse_enters(to_light) * under) * material_.base_color;
  }
  if (sheen_chance_ > 0.0) {
    const glm::dvec3 half = glm::normalize(surface_.to_viewer + to_light);
    result += sheen_->value(std::min(normal_to(to_light), 1.0), normal_to(half)) * extensions_.sheen_color;
  }
  return below_coat_both(to_light) * result;
}

double ExtendedBsdf::diffuse_pdf(const glm::dvec3& to_light) const {
  if (!same_side(to_light)) return 0.0;
  constexpr double kUniform = 0.5 * std::numbers::inv_pi;
  return sheen_chance_ * kUniform + (1.0 - sheen_chance_) * normal_to(to_light) * std::numbers::inv_pi;
}

/// Sheen from all over the hemisphere, the base by the cosine.
std::optional<BsdfSample> ExtendedBsdf::sample_diffuse(const glm::dvec2& u) const {
  BsdfSample sample;
  if (u.x < sheen_chance_) {
    const double z = u.x / sheen_chance_;
    const glm::dvec2 across = std::sqrt(std::max(0.0, 1.0 - z * z)) * warp::on_circle(u.y);
    sample.direction = glm::normalize(warp::basis_about(material_.normal) * glm::dvec3(across, z));
  } else {
    sample.direction = warp::cosine_lobe(material_.normal, {(u.x - sheen_chance_) / (1.0 - sheen_chance_), u.y});
  }
  sample.pdf = diffuse_pdf(sample.direction);
  if (!(sample.pdf > 0.0)) return std::nullopt;
  sample.weight = (normal_to(sample.direction) / sample.pdf) * diffuse_value(sample.direction);
  return sample;
}

glm::dvec3 ExtendedBsdf::reflection_value(const glm::dvec3& to_light) const {
  if (!scatters_ || is_delta(Lobe::Reflection) || !same_side(to_light)) return glm::dvec3(0.0);
  const double facets = anisotropic_ ? anisotropic_->value(to_light) : facets_.value(Lobe::Reflection, to_light).g;
  if (!(facets > 0.0)) return glm::dvec3(0.0);
  return (facets * below_both(to_light)) * fresnel(0.5 * glm::length(surface_.to_viewer + to_light));
}

std::optional<BsdfSample> ExtendedBsdf::sample_reflection(const glm::dvec2& u) const {
  BsdfSample sample;
  if (anisotropic_) {
    const auto direction = anisotropic_->sample(u);
    if (!direction || !same_side(*direction)) return std::nullopt;
    sample.direction = *direction;
    sample.pdf = anisotropic_->pdf(*direction);
    if (!(sample.pdf > 0.0) || !std::isfinite(sample.pdf)) return std::nullopt;
    sample.weight = (normal_to(*direction) / sample.pdf) * reflection_value(*direction);
    return sample;
  }
  const auto white = facets_.sample(Lobe::Reflection, u);
  if (!white) return std::nullopt;
  sample = *white;
  const double cosine =
      is_delta(Lobe::Reflection) ? normal_view_ : 0.5 * glm::length(surface_.to_viewer + sample.direction);
  sample.weight *= below_both(sample.direction) * fresnel(cosine);
  return sample;
}

/// The coat's cosine to the light over the material's own; 0 where it does not reflect to.
double ExtendedBsdf::coat_quotient(const glm::dvec3& to_light) const {
  if (!same_side(to_light)) return 0.0;
  return extensions_.clearcoat * std::max(0.0, glm::dot(extensions_.clearcoat_normal, to_light)) / normal_to(to_light);
}

std::optional<BsdfSample> ExtendedBsdf::sample_coat(const glm::dvec2& u) const {
  auto sample = coat_.sample(Lobe::Reflection, u);
  if (!sample) return sample;
  if (!coat_.is_delta(Lobe::Reflection) && !same_side(sample->direction)) return std::nullopt;
  sample->weight *= extensions_.clearcoat;
  return sample;
}

/// What the extensions leave of light that a plain surface lets through to there.
double ExtendedBsdf::transmission_scale(const glm::dvec3& to_light) const {
  double cosine = normal_view_;
  if (!plain_.is_delta(Lobe::Transmission)) {
    // As Bsdf's facets.
    const glm::dvec3 half = material_.solid && eta() != 1.0
                                ? surface_.to_viewer + eta() * to_light
                                : surface_.to_viewer + to_light - 2.0 * normal_to(to_light) * material_.normal;
    const double length = glm::length(half);
    cosine = length > 0.0 ? std::abs(glm::dot(surface_.to_viewer, half)) / length : normal_view_;
  }
  const double plain = plain_.dielectric_fresnel(cosine);
  const double kept = plain < 1.0 ? (1.0 - largest(dielectric(cosine, plain, eta()))) / (1.0 - plain) : 1.0;
  return kept * below_both(to_light);
}

std::optional<BsdfSample> ExtendedBsdf::sample_transmission(const glm::dvec2& u) const {
  auto sample = plain_.sample(Lobe::Transmission, u);
  if (sample) sample->weight *= transmission_scale(sample->direction);
  return sample;
}

/// Of a surface that light also goes through undiffused, Fresnel's equations count on the side of each direction.
double ExtendedBsdf::through_enters(double cosine, bool on_viewers_side) const {
  if (on_viewers_side || !is_exact() || !material_.solid) return enters(cosine);
  const double other = 1.0 / eta();
  return 1.0 - largest(dielectric(cosine, fresnel_exact(std::min(cosine, 1.0), other), other));
}

glm::dvec3 ExtendedBsdf::through_value(const glm::dvec3& to_light) const {
  if (!scatters_ || !other_side(to_light)) return glm::dvec3(0.0);
  const double entering = std::min(view_enters_, through_enters(-normal_to(to_light), false));
  return (through_ * std::numbers::inv_pi * entering * below_both(to_light)) * extensions_.diffuse_transmission_color;
}

std::optional<BsdfSample> ExtendedBsdf::sample_through(const glm::dvec2& u) const {
  BsdfSample sample;
  sample.direction = warp::cosine_lobe(-material_.normal, u);
  if (!other_side(sample.direction)) return std::nullopt;
  sample.pdf = -normal_to(sample.direction) * std::numbers::inv_pi;
  sample.weight = std::numbers::pi * through_value(sample.direction);
  return sample;
}

glm::dvec3 ExtendedBsdf::value(Lobe lobe, const glm::dvec3& to_light) const {
  switch (lobe) {
    case Lobe::Diffuse:
      return diffuse_value(to_light);
    case Lobe::Reflection:
      return reflection_value(to_light);
    case Lobe::Transmission: {
      const glm::dvec3 plain = plain_.value(Lobe::Transmission, to_light);
      return plain == glm::dvec3(0.0) ? plain : transmission_scale(to_light) * plain;
    }
    case Lobe::Coat:
      return present(Lobe::Coat) ? coat_quotient(to_light) * coat_.value(Lobe::Reflection, to_light) : glm::dvec3(0.0);
    case Lobe::DiffuseTransmission:
      return through_value(to_light);
  }
  return glm::dvec3(0.0);
}

double ExtendedBsdf::pdf(Lobe lobe, const glm::dvec3& to_light) const {
  if (!present(lobe)) return 0.0;
  switch (lobe) {
    case Lobe::Diffuse:
      return diffuse_pdf(to_light);
    case Lobe::Reflection:
      if (is_delta(lobe) || !same_side(to_light)) return 0.0;
      return anisotropic_ ? anisotropic_->pdf(to_light) : facets_.pdf(Lobe::Reflection, to_light);
    case Lobe::Transmission:
      return plain_.pdf(Lobe::Transmission, to_light);
    case Lobe::Coat:
      return same_side(to_light) ? coat_.pdf(Lobe::Reflection, to_light) : 0.0;
    case Lobe::DiffuseTransmission:
      return other_side(to_light) ? -normal_to(to_light) * std::numbers::inv_pi : 0.0;
  }
  return 0.0;
}

std::optional<BsdfSample> ExtendedBsdf::sample(Lobe lobe, const glm::dvec2& u) const {
  if (!present(lobe)) return std::nullopt;
  switch (lobe) {
    case Lobe::Diffuse:
      return sample_diffuse(u);
    case Lobe::Reflection:
      return sample_reflection(u);
    case Lobe::Transmission:
      return sample_transmission(u);
    case Lobe::Coat:
      return sample_coat(u);
    case Lobe::DiffuseTransmission:
      return sample_through(u);
  }
  return std::nullopt;
}

bool ExtendedBsdf::present(Lobe lobe) const {
  if (!scatters_) return false;
  switch (lobe) {
    case Lobe::Diffuse:
      return sheen_chance_ > 0.0 || (diffuse_ * largest(material_.base_color) > 0.0 && view_enters_ > 0.0);
    case Lobe::Reflection:
      return material_.metallic > 0.0 || extensions_.iridescence > 0.0 ||
             (material_.ior != 1.0 && (extensions_.specular > 0.0 || (is_exact() && is_within(surface_.to_viewer))));
    case Lobe::Transmission:
      return plain_.present(Lobe::Transmission);
    case Lobe::Coat:
      return extensions_.clearcoat > 0.0 && !is_within(surface_.to_viewer) && coat_.present(Lobe::Reflection);
    case Lobe::DiffuseTransmission:
      return through_ * largest(extensions_.diffuse_transmission_color) > 0.0;
  }
  return false;
}

glm::dvec3 ExtendedBsdf::weight(Lobe lobe) const {
  if (!present(lobe)) return glm::dvec3(0.0);
  if (is_delta(lobe)) {
    const auto only = sample(lobe, glm::dvec2(0.5));
    return only ? only->weight : glm::dvec3(0.0);
  }
  const double under_coat = below_coat(surface_.to_viewer);
  const double under = under_coat * view_below_sheen_;
  switch (lobe) {
    case Lobe::Diffuse: {
      const double sheen =
          sheen_chance_ > 0.0 ? std::max(sheen_albedo(extensions_.sheen_roughness, normal_view_), kMinWeight) : 0.0;
      return (under_coat * sheen) * extensions_.sheen_color + (under * diffuse_ * base_enters()) * material_.base_color;
    }
    case Lobe::Reflection: {
      const double dielectric =
          is_exact() ? plain_.facet_share(Lobe::Reflection) : plain_.dielectric_fresnel(normal_view_);
      return glm::max(under * fresnel(normal_view_, dielectric), kMinWeight);
    }
    case Lobe::Transmission: {
      const double plain = plain_.dielectric_fresnel(normal_view_);
      const double kept = plain < 1.0 ? view_enters_ / (1.0 - plain) : 1.0;
      return std::max(under * kept, kMinWeight) * plain_.weight(Lobe::Transmission);
    }
    case Lobe::Coat:
      return extensions_.clearcoat * coat_.weight(Lobe::Reflection);
    case Lobe::DiffuseTransmission:
      return (under * through_ * std::max(view_enters_, kMinWeight)) * extensions_.diffuse_transmission_color;
  }
  return glm::dvec3(0.0);
}

bool ExtendedBsdf::is_delta(Lobe lobe) const {
  switch (lobe) {
    case Lobe::Reflection:
      return !anisotropic_ && facets_.is_delta(Lobe::Reflection);
    case Lobe::Transmission:
      return plain_.is_delta(Lobe::Transmission);
    case Lobe::Coat:
      return coat_.is_delta(Lobe::Reflection);
    case Lobe::Diffuse:
    case Lobe::DiffuseTransmission:
      break;
  }
  return false;
}

}  // namespace hpr
