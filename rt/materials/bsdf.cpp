#include "rt/materials/bsdf.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/exponential.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <numbers>

#include "rt/materials/extended_bsdf.h"
#include "rt/materials/microfacets.h"
#include "rt/sampling/sampling.h"

namespace hpr {
namespace {

/// Lobes that are present but give nothing in the viewer's own mirror or refracted direction keep this chance.
constexpr double kMinWeight = 1e-3;
/// And facets as rough as this or more this one: so many of them may lie outside the directions that are looked at.
constexpr double kMinFacetWeight = 0.1;
constexpr double kWideAlpha = 0.05;
/// Facets of almost the same index on both sides bend light by less than their own slope.
constexpr double kNarrowest = squared(Bsdf::kDeltaRoughness);
/// Cosines below it are edge-on: nothing is seen or lit there, and no quotient of cosines overflows.
constexpr double kEdgeOn = 1e-9;

constexpr double square(double x) {
  return squared(x);
}

double largest(const glm::dvec3& v) {
  return std::max({v.x, v.y, v.z});
}

}  // namespace

Bsdf::Bsdf(const MaterialPoint& material, const SurfacePoint& surface, Carried carried)
    : view_(surface.to_viewer),
      normal_(material.normal),
      geometric_normal_(surface.geometric_normal),
      base_color_(material.base_color),
      roughness_(material.roughness),
      alpha2_(square(square(material.roughness))),
      metallic_(material.metallic),
      solid_(material.solid),
      exact_(material.transmission > 0.0),
      all_mirror_(!(material.ior > 0.0)),
      unlit_(material.unlit) {
  diffuse_ = (1.0 - metallic_) * (1.0 - material.transmission);
  f0_ = all_mirror_ ? 1.0 : square((material.ior - 1.0) / (material.ior + 1.0));
  reflects_ = material.ior != 1.0;
  if (exact_ && !all_mirror_) {
    tint_ = (1.0 - metallic_) * material.transmission * (solid_ ? glm::sqrt(base_color_) : base_color_);
    eta_ = solid_ && surface.inside ? 1.0 / material.ior : material.ior;
    if (solid_ && carried == Carried::Radiance) squeeze_ = 1.0 / square(eta_);
    if (material.channel != MaterialPoint::kAllChannels) {
      glm::dvec3 chosen(0.0);
      chosen[material.channel] = static_cast<double>(material.channel_scale) * tint_[material.channel];
      tint_ = chosen;
    }
  }
  look();
  if (material.extensions) {
    extended_ = std::make_shared<const ExtendedBsdf>(material, surface, carried);
  } else if (disperses(material) && shares_directions(material)) {
    std::array<Bsdf, 3> channels;
    for (int channel = 0; channel < 3; ++channel) {
      MaterialPoint only = material;
      set_channel(only, channel, 1.0);
      channels[static_cast<std::size_t>(channel)] = Bsdf(only, surface, carried);
    }
    channels_ = std::make_shared<const std::array<Bsdf, 3>>(channels);
  }
  find_lobes();
}

bool Bsdf::shares_directions(const MaterialPoint& material) {
  return material.roughness >= kDeltaRoughness &&
         square(material.roughness) * (1.0 - 1.0 / std::max(material.ior - material.ior_spread, 1.0)) >= kNarrowest;
}

/// Sets what depends on the viewer, but for the lobes.
void Bsdf::look() {
  normal_view_ = glm::dot(normal_, view_);
  scatters_ = !unlit_ && normal_view_ > kEdgeOn && glm::dot(geometric_normal_, view_) > 0.0;
  normal_view_ = std::min(normal_view_, 1.0);
  view_smith_ = std::sqrt(alpha2_ + (1.0 - alpha2_) * square(normal_view_));
  if (scatters_) bounded_view_ = mirrored_bound(normal_view_, alpha2_) * normal_view_;
  if (!exact_ || all_mirror_ || !(diffuse_ > 0.0)) return;
  view_enters_ = (1.0 - dielectric_fresnel(normal_view_)) / entering(std::max(eta_, 1.0 / eta_));
}

/// Sets present_ and delta_ by all other members.
void Bsdf::find_lobes() {
  present_ = delta_ = 0;
  if (extended_) {
    for (const Lobe lobe : kLobes) {
      if (extended_->present(lobe)) present_ |= set_of(lobe);
      if (extended_->is_delta(lobe)) delta_ |= set_of(lobe);
    }
    return;
  }
  if (roughness_ < kDeltaRoughness) {
    delta_ = set_of(Lobe::Reflection) | set_of(Lobe::Transmission);
  } else if (solid_ && square(roughness_) * std::abs(eta_ - 1.0) < kNarrowest) {
    delta_ = set_of(Lobe::Transmission);
  }
  if (!scatters_) return;
  if (reflects_ || metallic_ > 0.0) present_ |= set_of(Lobe::Reflection);
  if (largest(tint_) > 0.0) present_ |= set_of(Lobe::Transmission);
  if (!all_mirror_ && diffuse_ * largest(base_color_) > 0.0 && (!exact_ || view_enters_ > 0.0)) {
    present_ |= set_of(Lobe::Diffuse);
  }
}

Bsdf Bsdf::seen_from(const glm::dvec3& to_viewer, const glm::dvec3& normal) const {
  Bsdf other = *this;
  other.view_ = to_viewer;
  other.normal_ = normal;
  other.look();
  if (extended_) other.extended_ = std::make_shared<const ExtendedBsdf>(extended_->seen_from(to_viewer, normal));
  if (channels_) {
    std::array<Bsdf, 3> channels;
    std::ranges::transform(*channels_, channels.begin(), [&](const Bsdf& b) { return b.seen_from(to_viewer, normal); });
    other.channels_ = std::make_shared<const std::array<Bsdf, 3>>(channels);
  }
  other.find_lobes();
  return other;
}

inline bool Bsdf::same_side(const glm::dvec3& to_light) const {
  return glm::dot(normal_, to_light) > kEdgeOn && glm::dot(geometric_normal_, to_light) > 0.0;
}

inline bool Bsdf::other_side(const glm::dvec3& to_light) const {
  return glm::dot(normal_, to_light) < -kEdgeOn && glm::dot(geometric_normal_, to_light) < 0.0;
}

double Bsdf::dielectric_fresnel(double cosine) const {
  if (all_mirror_) return 1.0;
  if (!reflects_) return 0.0;
  const double c = std::clamp(cosine, 0.0, 1.0);
  if (exact_) return fresnel_exact(c, eta_);
  const double m = 1.0 - c;
  return f0_ + (1.0 - f0_) * (square(square(m)) * m);
}

inline glm::dvec3 Bsdf::fresnel(double cosine, double dielectric) const {
  glm::dvec3 result((1.0 - metallic_) * dielectric);
  if (metallic_ > 0.0) {
    const double m = 1.0 - std::clamp(cosine, 0.0, 1.0);
    const double weight = square(square(m)) * m;
    result += metallic_ * (base_color_ + (glm::dvec3(1.0) - base_color_) * weight);
  }
  return result;
}

/// Each channel by its own index: near the critical angle one is let through that another is not.
glm::dvec3 Bsdf::fresnel_by_channel(double cosine, double dielectric) const {
  glm::dvec3 result = fresnel(cosine, dielectric);
  for (int c = 0; c < 3; ++c) {
    const double own = (*channels_)[static_cast<std::size_t>(c)].dielectric_fresnel(cosine);
    result[c] += (1.0 - metallic_) * (own - dielectric);
  }
  return result;
}

inline glm::dvec3 Bsdf::fresnel_of_facets(double cosine, double dielectric) const {
  return channels_ ? fresnel_by_channel(cosine, dielectric) : fresnel(cosine, dielectric);
}

inline double Bsdf::distribution(const glm::dvec3& half) const {
  // (n.h)^2 (alpha^2 - 1) + 1 without the cancellation that costs all digits of a narrow lobe.
  const glm::dvec3 across = glm::cross(normal_, half);
  const double spread = glm::dot(across, across) + alpha2_ * square(glm::dot(normal_, half));
  return alpha2_ / (std::numbers::pi * spread * spread);
}

/// Heitz 2014, equation 99, over 4 |n.v| |n.l|.
inline double Bsdf::shadowing(double normal_light) const {
  const double light_smith = std::sqrt(alpha2_ + (1.0 - alpha2_) * square(normal_light));
  return 0.5 / (normal_light * view_smith_ + normal_view_ * light_smith);
}

/// None where the lobe does not scatter to.
std::optional<Bsdf::Facet> Bsdf::facet(Lobe lobe, const glm::dvec3& to_light) const {
  const bool through = lobe == Lobe::Transmission;
  if (!scatters_ || !(through ? other_side(to_light) : same_side(to_light))) return std::nullopt;
  Facet facet;
  facet.normal_light = std::abs(glm::dot(normal_, to_light));
  glm::dvec3 half;
  if (through && refracts()) {
    // Walter et al. 2007, equation 16, turned to the viewer's side.
    half = view_ + eta_ * to_light;
    facet.stretch = glm::dot(half, half);
    half *= (glm::dot(half, normal_) < 0.0 ? -1.0 : 1.0) / std::sqrt(facet.stretch);
    facet.view_half = glm::dot(view_, half);
    facet.light_half = -glm::dot(to_light, half);
  } else {
    // What goes through a rough sheet is its mirror image carried to the other side.
    const glm::dvec3 reflected = through ? to_light + 2.0 * facet.normal_light * normal_ : to_light;
    half = view_ + reflected;
    const double length = glm::length(half);
    half /= length;
    facet.view_half = facet.light_half = 0.5 * length;
  }
  if (!(facet.view_half > 0.0) || !(facet.light_half > 0.0)) return std::nullopt;
  facet.distribution = distribution(half);
  return facet;
}

/// What the specular layer leaves to the diffuse lobe.
double Bsdf::below(const glm::dvec3& to_light, double dielectric) const {
  if (!exact_) return 1.0 - dielectric;
  return view_enters_ * (1.0 - dielectric_fresnel(glm::dot(normal_, to_light)));
}

glm::dvec3 Bsdf::reflected(const glm::dvec3& to_light, bool diffuse, bool specular) const {
  glm::dvec3 result(0.0);
  if (extended_) {
    if (diffuse) result += extended_->value(Lobe::Diffuse, to_light);
    if (specular) result += extended_->value(Lobe::Reflection, to_light) + extended_->value(Lobe::Coat, to_light);
    return result;
  }
  if (!scatters_ || !same_side(to_light)) return result;
  // Both directions lie on the normal's side, so their sum cannot vanish.
  const glm::dvec3 sum = view_ + to_light;
  const double length = glm::length(sum);
  const double dielectric = dielectric_fresnel(0.5 * length);
  if (diffuse) result = (diffuse_ / std::numbers::pi * below(to_light, dielectric)) * base_color_;
  if (!specular || roughness_ < kDeltaRoughness) return result;
  const double common = distribution(sum / length) * shadowing(glm::dot(normal_, to_light));
  return result + common * fresnel_of_facets(0.5 * length, dielectric);
}

ReflectionTerms Bsdf::reflection_terms(bool diffuse, bool specular) const {
  ReflectionTerms terms;
  if (!scatters_) return terms;
  terms.view = view_;
  terms.normal = normal_;
  terms.geometric_normal = geometric_normal_;
  if (diffuse) terms.diffuse = (diffuse_ / std::numbers::pi * (exact_ ? view_enters_ : 1.0)) * base_color_;
  terms.tint = metallic_ * base_color_;
  terms.edge_on = static_cast<float>(kEdgeOn);
  terms.normal_view = static_cast<float>(normal_view_);
  terms.view_smith = static_cast<float>(view_smith_);
  terms.alpha2 = static_cast<float>(alpha2_);
  terms.metallic = static_cast<float>(metallic_);
  if (all_mirror_ || reflects_) {
    terms.f0 = all_mirror_ ? 1.0F : static_cast<float>(f0_);
    terms.rise = 1.0F - terms.f0;
  }
  if (exact_ && reflects_ && !all_mirror_) terms.eta = static_cast<float>(eta_);
  terms.specular = specular && roughness_ >= kDeltaRoughness;
  return terms;
}

glm::dvec3 Bsdf::value(Lobe lobe, const glm::dvec3& to_light) const {
  if (extended_) return extended_->value(lobe, to_light);
  if (is_extension(lobe)) return glm::dvec3(0.0);
  if (lobe != Lobe::Transmission) return reflected(to_light, lobe == Lobe::Diffuse, lobe == Lobe::Reflection);
  if (channels_) {
    glm::dvec3 result(0.0);
    for (int c = 0; c < 3; ++c) result[c] = (*channels_)[static_cast<std::size_t>(c)].value(lobe, to_light)[c];
    return result;
  }
  if (is_delta(lobe)) return glm::dvec3(0.0);
  const auto at = facet(lobe, to_light);
  if (!at) return glm::dvec3(0.0);
  const double common = at->distribution * shadowing(at->normal_light);
  glm::dvec3 result = (common * (1.0 - dielectric_fresnel(at->view_half))) * tint_;
  // Walter et al. 2007, equation 21; the square of the index belongs to the carried quantity.
  if (refracts()) result *= 4.0 * at->view_half * at->light_half * square(eta_) * squeeze_ / at->stretch;
  return result;
}

/// The integral that sampled normals are normalised by, times 2: of all that are visible, or of the bounded ones.
double Bsdf::sampled_normals(Lobe lobe) const {
  return 2.0 * ((lobe == Lobe::Reflection ? bounded_view_ : normal_view_) + view_smith_);
}

double Bsdf::facet_pdf(Lobe lobe, const Facet& facet) const {
  // The density of visible normals, G1 D v.h / n.v, with the Jacobian of the reflection, 1 / (4 v.h).
  const double pdf = facet.distribution / sampled_normals(lobe);
  if (lobe == Lobe::Reflection || !refracts()) return pdf;
  return pdf * 4.0 * facet.view_half * facet.light_half * square(eta_) / facet.stretch;
}

double Bsdf::pdf(Lobe lobe, const glm::dvec3& to_light) const {
  if (extended_) return extended_->pdf(lobe, to_light);
  if (!present(lobe)) return 0.0;
  if (lobe == Lobe::Diffuse) {
    return same_side(to_light) ? glm::dot(normal_, to_light) / std::numbers::pi : 0.0;
  }
  if (lobe == Lobe::Transmission && channels_) {
    double sum = 0.0;
    for (const Bsdf& channel : *channels_) sum += channel.pdf(lobe, to_light);
    return sum / 3.0;
  }
  if (is_delta(lobe)) return 0.0;
  const auto at = facet(lobe, to_light);
  if (!at) return 0.0;
  // Beyond the critical angle a facet lets nothing through, and sampling fails.
  if (lobe == Lobe::Transmission && dielectric_fresnel(at->view_half) >= 1.0) return 0.0;
  return facet_pdf(lobe, *at);
}

Scattering Bsdf::scattering(const glm::dvec3& to_light) const {
  constexpr auto kDiffuse = static_cast<std::size_t>(Lobe::Diffuse);
  constexpr auto kReflection = static_cast<std::size_t>(Lobe::Reflection);
  constexpr auto kTransmission = static_cast<std::size_t>(Lobe::Transmission);
  Scattering all;
  if (extended_) {
    for (const Lobe lobe : kLobes) {
      all.value[static_cast<std::size_t>(lobe)] = extended_->value(lobe, to_light);
      all.pdf[static_cast<std::size_t>(lobe)] = extended_->pdf(lobe, to_light);
    }
    return all;
  }
  if (!scatters_) return all;
  if (!same_side(to_light)) {
    all.value[kTransmission] = value(Lobe::Transmission, to_light);
    all.pdf[kTransmission] = pdf(Lobe::Transmission, to_light);
    return all;
  }
  const glm::dvec3 sum = view_ + to_light;
  const double length = glm::length(sum);
  const double dielectric = dielectric_fresnel(0.5 * length);
  all.value[kDiffuse] = (diffuse_ / std::numbers::pi * below(to_light, dielectric)) * base_color_;
  if (present(Lobe::Diffuse)) all.pdf[kDiffuse] = glm::dot(normal_, to_light) / std::numbers::pi;
  if (roughness_ < kDeltaRoughness) return all;
  const double facets = distribution(sum / length);
  const double common = facets * shadowing(glm::dot(normal_, to_light));
  all.value[kReflection] = common * fresnel_of_facets(0.5 * length, dielectric);
  if (present(Lobe::Reflection)) all.pdf[kReflection] = facets / sampled_normals(Lobe::Reflection);
  return all;
}

/// The root mean square of what the facets that the viewer sees reflect, or let through: chances in proportion to it
/// make samples vary least. At grazing angles and about the critical one the shares of facets are far from that of the
/// surface's own normal.
double Bsdf::facet_share(Lobe lobe) const {
  constexpr std::array<double, 4> kFractions{0.125, 0.375, 0.625, 0.875};
  constexpr double kDiagonal = 0.5 * std::numbers::sqrt2;
  constexpr std::array<glm::dvec2, 2> kAround{glm::dvec2{kDiagonal, kDiagonal}, glm::dvec2{-kDiagonal, kDiagonal}};
  const double alpha = square(roughness_);
  const glm::dvec3 view(std::sqrt(std::max(0.0, 1.0 - square(normal_view_))), 0.0, normal_view_);
  double sum = 0.0;
  for (const double fraction : kFractions) {
    for (const glm::dvec2& around : kAround) {
      const double reflected =
          dielectric_fresnel(glm::dot(view, visible_normal(view, glm::dvec2(alpha), 1.0, fraction, around)));
      sum += square(lobe == Lobe::Reflection ? reflected : 1.0 - reflected);
    }
  }
  const double least = std::max(kMinFacetWeight * std::min(alpha / kWideAlpha, 1.0), kMinWeight);
  return std::max(std::sqrt(sum / (kFractions.size() * kAround.size())), least);
}

glm::dvec3 Bsdf::weight(Lobe lobe) const {
  if (extended_) return extended_->weight(lobe);
  if (!present(lobe)) return glm::dvec3(0.0);
  const bool single = is_delta(lobe);
  if (lobe == Lobe::Reflection) {
    if (exact_ && !single) return fresnel(normal_view_, facet_share(lobe));
    const glm::dvec3 straight = fresnel(normal_view_, dielectric_fresnel(normal_view_));
    return single ? straight : glm::max(straight, kMinWeight);
  }
  if (lobe == Lobe::Diffuse) {
    if (exact_) return (diffuse_ * view_enters_) * base_color_;
    // Most light comes from where facets half-way to the viewer reflect as if looked at straight, however he looks.
    return (diffuse_ * std::max(1.0 - f0_, kMinWeight)) * base_color_;
  }
  return (single ? (1.0 - dielectric_fresnel(normal_view_)) * squeeze_ : facet_share(lobe)) * tint_;
}

/// The viewer's direction refracted at facets of `normal`; none where all is reflected.
std::optional<glm::dvec3> Bsdf::refracted(const glm::dvec3& normal) const {
  const double cosine = glm::dot(view_, normal);
  const double sine2 = std::max(0.0, 1.0 - square(cosine)) / square(eta_);
  if (!(sine2 < 1.0)) return std::nullopt;
  return glm::normalize((cosine / eta_ - std::sqrt(1.0 - sine2)) * normal - view_ / eta_);
}

std::optional<BsdfSample> Bsdf::sample_diffuse(const glm::dvec2& u) const {
  BsdfSample sample;
  sample.direction = warp::cosine_lobe(normal_, u);
  if (!same_side(sample.direction)) return std::nullopt;
  sample.pdf = glm::dot(normal_, sample.direction) / std::numbers::pi;
  sample.weight = std::numbers::pi * value(Lobe::Diffuse, sample.direction);
  return sample;
}

std::optional<BsdfSample> Bsdf::sample_facet(Lobe lobe, const glm::dvec2& u) const {
  const glm::dmat3 frame = warp::basis_about(normal_);
  const double bound = lobe == Lobe::Reflection ? bounded_view_ / normal_view_ : 1.0;
  const glm::dvec3 half =
      frame * visible_normal(view_ * frame, glm::dvec2(square(roughness_)), bound, u.x, warp::on_circle(u.y));
  const double view_half = glm::dot(view_, half);
  const glm::dvec3 reflected = 2.0 * view_half * half - view_;
  BsdfSample sample;
  if (lobe == Lobe::Reflection) {
    sample.direction = glm::normalize(reflected);
  } else if (refracts()) {
    const auto direction = refracted(half);
    if (!direction) return std::nullopt;
    sample.direction = *direction;
  } else {
    const double height = glm::dot(reflected, normal_);
    if (!(height > 0.0)) return std::nullopt;
    sample.direction = glm::normalize(reflected - 2.0 * height * normal_);
  }
  const auto at = facet(lobe, sample.direction);
  if (!at) return std::nullopt;
  sample.pdf = facet_pdf(lobe, *at);
  if (!(sample.pdf > 0.0) || !std::isfinite(sample.pdf)) return std::nullopt;
  // f cos / pdf is Fresnel's term times G2 / G1, in a form that holds at grazing angles.
  const double kept = sampled_normals(lobe) * at->normal_light * shadowing(at->normal_light);
  sample.weight = lobe == Lobe::Reflection
                      ? kept * fresnel_of_facets(at->view_half, dielectric_fresnel(at->view_half))
                      : (kept * (1.0 - dielectric_fresnel(at->view_half)) * (refracts() ? squeeze_ : 1.0)) * tint_;
  return sample;
}

std::optional<BsdfSample> Bsdf::sample_single(Lobe lobe) const {
  BsdfSample sample;
  sample.weight = weight(lobe);
  if (!(largest(sample.weight) > 0.0)) return std::nullopt;
  if (lobe == Lobe::Reflection) {
    sample.direction = 2.0 * normal_view_ * normal_ - view_;
  } else if (refracts()) {
    const auto direction = refracted(normal_);
    if (!direction) return std::nullopt;
    sample.direction = *direction;
  } else {
    sample.direction = -view_;
    return sample;
  }
  const double height = glm::dot(sample.direction, geometric_normal_);
  if (lobe == Lobe::Reflection ? height < 0.0 : height > 0.0) sample.direction -= 2.0 * height * geometric_normal_;
  sample.direction = glm::normalize(sample.direction);
  return sample;
}

/// A direction by one channel's lobe, for all channels (Wilkie, Nawaz, Droske, Weidlich, Hanika, "Hero Wavelength
/// Spectral Sampling", 2014).
std::optional<BsdfSample> Bsdf::sample_channels(const glm::dvec2& u) const {
  const double channel = std::min(std::floor(3.0 * u.x), 2.0);
  auto sample = (*channels_)[static_cast<std::size_t>(channel)].sample(Lobe::Transmission, {3.0 * u.x - channel, u.y});
  if (!sample) return sample;
  sample->pdf = pdf(Lobe::Transmission, sample->direction);
  const double cosine = std::abs(glm::dot(normal_, sample->direction));
  sample->weight = (cosine / sample->pdf) * value(Lobe::Transmission, sample->direction);
  return sample;
}

double Bsdf::coat_roughness() const {
  return extended_->coat_roughness();
}

std::optional<BsdfSample> Bsdf::sample(Lobe lobe, const glm::dvec2& u) const {
  if (extended_) return extended_->sample(lobe, u);
  if (!present(lobe)) return std::nullopt;
  if (lobe == Lobe::Diffuse) return sample_diffuse(u);
  if (lobe == Lobe::Transmission && channels_) return sample_channels(u);
  return is_delta(lobe) ? sample_single(lobe) : sample_facet(lobe, u);
}

}  // namespace hpr
