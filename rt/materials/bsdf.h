#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <span>

#include "rt/materials/material_point.h"
#include "rt/trace/surfaces.h"

namespace hpr {

/// The ways light leaves a surface. Each pass has its own.
enum class Lobe : std::uint8_t {
  Diffuse,              ///< Lambert's
  Reflection,           ///< of the specular layer or metal: a mirror below Bsdf::kDeltaRoughness, else GGX
  Transmission,         ///< through the surface: refracted when solid, straight on when thin; GGX when rough
  Coat,                 ///< reflection of KHR_materials_clearcoat, by a normal and a roughness of its own
  DiffuseTransmission,  ///< KHR_materials_diffuse_transmission: Lambert's law on the other side
};
inline constexpr std::array<Lobe, 5> kLobes{Lobe::Diffuse, Lobe::Reflection, Lobe::Transmission, Lobe::Coat,
                                            Lobe::DiffuseTransmission};

/// Some lobes: one bit each.
using LobeSet = std::uint8_t;

[[nodiscard]] constexpr LobeSet set_of(Lobe lobe) {
  return static_cast<LobeSet>(1U << static_cast<unsigned>(lobe));
}

/// Whether only surfaces with extensions have the lobe.
[[nodiscard]] constexpr bool is_extension(Lobe lobe) {
  return lobe == Lobe::Coat || lobe == Lobe::DiffuseTransmission;
}

/// The lobe that the passes treat as they do `lobe`, which only surfaces with extensions have.
[[nodiscard]] constexpr Lobe extension_of(Lobe lobe) {
  return lobe == Lobe::Transmission ? Lobe::DiffuseTransmission : Lobe::Coat;
}

class ExtendedBsdf;

/// Whether radiance (towards the eye) or flux (photons, away from lights) is carried: refraction squeezes radiance by
/// the square of the relative index (Veach 1997, section 5.2).
enum class Carried : std::uint8_t { Radiance, Flux };

/// What all lobes do with light from one direction.
struct Scattering {
  std::array<glm::dvec3, kLobes.size()> value{glm::dvec3(0.0), glm::dvec3(0.0), glm::dvec3(0.0)};  ///< f, 1/sr
  std::array<double, kLobes.size()> pdf{};  ///< of sampling that direction, per solid angle
};

struct BsdfSample {
  glm::dvec3 direction{0.0};  ///< unit length, away from the surface
  glm::dvec3 weight{0.0};     ///< f |cos| / pdf
  double pdf = 0.0;           ///< per solid angle; 0 when the lobe has one direction only
};

/// What Bsdf::reflected() works from, in single precision: for many directions at once.
struct ReflectionTerms {
  glm::vec3 view{0.0F};
  glm::vec3 normal{0.0F};
  glm::vec3 geometric_normal{0.0F};
  glm::vec3 diffuse{0.0F};  ///< of the base, 1/sr, before Fresnel's term
  glm::vec3 tint{0.0F};     ///< of the metal, its share included
  float edge_on = 0.0F;     ///< cosines to the normal up to here are none
  float normal_view = 0.0F;
  float view_smith = 1.0F;
  float alpha2 = 1.0F;
  float metallic = 0.0F;  ///< share
  float f0 = 0.0F;        ///< of the dielectric, whose Schlick term is f0 + rise (1 - v.h)^5
  float rise = 0.0F;
  float eta = 0.0F;       ///< its index where Fresnel's own equations hold, else 0
  bool specular = false;  ///< whether facets reflect
};

/// How a surface scatters light at one place: glTF 2.0, appendix B, with KHR_materials_transmission, _volume and _ior.
/// A dielectric base (Lambert, or transmission, under a specular layer) mixed with a metal; GGX distribution (Walter,
/// Marschner, Li, Torrance, "Microfacet Models for Refraction through Rough Surfaces", 2007) with alpha = roughness^2,
/// height-correlated Smith shadowing (Heitz, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs",
/// 2014), Schlick's Fresnel term; the exact one for surfaces that transmit. An index of refraction of 1 reflects
/// nothing at any angle, where Schlick's term alone would. All directions point away from the surface and have unit
/// length.
///
/// The base of surfaces that transmit in part, which light enters and leaves by Fresnel's equations, scatters in
/// proportion to (1 - F(n.v)) (1 - F(n.l)) (Shirley, Smits, Hu, Lafortune, "A practitioners' assessment of light
/// reflection models", 1997): from outside a smooth white one loses nothing, from inside nothing comes from where all
/// is reflected. That of others scatters by 1 - F(v.h), as the specification has it.
///
/// As the specification has it, a white opaque dielectric reflects up to 1.3 times what arrives towards grazing viewers
/// and 1.05 times in the mean; metals and surfaces that transmit never exceed 1.
///
/// Light that is let through takes the base colour once: at a thin sheet's single crossing; at a solid's surface its
/// square root, so that the two surfaces of a pane together show it.
class Bsdf {
 public:
  /// To be assigned to.
  Bsdf() = default;
  /// Copies what it needs. The surface's `inside` says that the viewer's side is inside the volume (solid materials).
  Bsdf(const MaterialPoint& material, const SurfacePoint& surface, Carried carried = Carried::Radiance);
  /// This BSDF for another viewer on the same side, with the normal that is shaded with there.
  [[nodiscard]] Bsdf seen_from(const glm::dvec3& to_viewer, const glm::dvec3& normal) const;

  /// f of one lobe in 1/sr. Never negative, never NaN; 0 for lobes of one direction, and where the geometric and the
  /// shading normal do not agree on the side.
  [[nodiscard]] glm::dvec3 value(Lobe lobe, const glm::dvec3& to_light) const;
  /// The sum over Diffuse and Reflection, or one of them: cheaper than one by one.
  [[nodiscard]] glm::dvec3 reflected(const glm::dvec3& to_light, bool diffuse = true, bool specular = true) const;
  /// The terms that reflected() is computed from, for many directions. A surface that scatters nothing has black terms.
  [[nodiscard]] ReflectionTerms reflection_terms(bool diffuse, bool specular) const;
  /// The density of sample(lobe), per solid angle; 0 where value is 0 by direction, and for lobes of one direction.
  [[nodiscard]] double pdf(Lobe lobe, const glm::dvec3& to_light) const;
  /// value and pdf of every lobe, bit for bit, in one go.
  [[nodiscard]] Scattering scattering(const glm::dvec3& to_light) const;
  /// None when the lobe is absent or the sample fails (below the surface). Lobes of one direction ignore `u` and do not
  /// fail for being below the surface: there a smooth normal's mirror image or refracted direction is put back on its
  /// side. GGX by visible normals (Heitz, "Sampling the GGX Distribution of Visible Normals", 2018), for reflection
  /// less those that mirror into the surface (Eto and Tokuyoshi, "Bounded VNDF Sampling for Smith-GGX Reflections",
  /// 2023).
  [[nodiscard]] std::optional<BsdfSample> sample(Lobe lobe, const glm::dvec2& u) const;
  /// Whether the surface has the lobe at all.
  [[nodiscard]] bool present(Lobe lobe) const { return (present_ & set_of(lobe)) != 0; }
  /// The normal that lights are chosen by: zero where they may shine through.
  [[nodiscard]] glm::dvec3 light_normal() const {
    return present(Lobe::Transmission) || present(Lobe::DiffuseTransmission) ? glm::dvec3(0.0) : normal_;
  }
  /// About the share of light that the lobe scatters towards the viewer: for choosing among lobes. Exact for lobes of
  /// one direction; for others never so low that a sample's weight, refraction's squeeze apart, is over 50 times as
  /// much. Zero exactly where the lobe is absent.
  [[nodiscard]] glm::dvec3 weight(Lobe lobe) const;
  /// Whether the lobe has a single direction: a perfect mirror, clear glass, rough glass of an index of almost 1.
  [[nodiscard]] bool is_delta(Lobe lobe) const { return (delta_ & set_of(lobe)) != 0; }
  /// Of the facets of a specular lobe.
  [[nodiscard]] double roughness(Lobe lobe = Lobe::Reflection) const {
    return lobe == Lobe::Coat && extended_ ? coat_roughness() : roughness_;
  }
  /// Whether the material has extensions that change it (see ExtendedBsdf).
  [[nodiscard]] bool is_extended() const { return extended_ != nullptr; }
  /// All lobes that the surface may have.
  [[nodiscard]] std::span<const Lobe> lobes() const { return std::span(kLobes).first(extended_ ? kLobes.size() : 3); }
  /// f of all lobes: 1/sr.
  [[nodiscard]] glm::dvec3 total(const glm::dvec3& to_light) const {
    const glm::dvec3 base = reflected(to_light) + value(Lobe::Transmission, to_light);
    return extended_ ? base + value(Lobe::DiffuseTransmission, to_light) : base;
  }
  /// Fresnel's term of the dielectric without its extensions, `cosine` off the normal.
  [[nodiscard]] double dielectric_fresnel(double cosine) const;
  /// Of a rough dielectric by Fresnel's equations: what weight() has of its lobes before tints and metal.
  [[nodiscard]] double facet_share(Lobe lobe) const;

  /// Whether the channels that a surface bends otherwise go on in wide lobes, of which one direction serves all: with
  /// kAllChannels they do, by the balance heuristic over the densities of each.
  [[nodiscard]] static bool shares_directions(const MaterialPoint& material);

  /// Below it a specular lobe is narrower than 1e-6 rad and has one direction.
  static constexpr double kDeltaRoughness = 1e-3;

 private:
  /// Directions of a microfacet lobe, reduced to what its formulas need.
  struct Facet {
    double normal_light = 0.0;  ///< |n.l|
    double view_half = 0.0;     ///< v.h
    double light_half = 0.0;    ///< |l.h|
    double distribution = 0.0;  ///< D(h), 1/sr
    double stretch = 1.0;       ///< |v + eta l|^2 for refraction
  };

  void look();
  void find_lobes();
  [[nodiscard]] double coat_roughness() const;
  [[nodiscard]] bool same_side(const glm::dvec3& to_light) const;
  [[nodiscard]] bool other_side(const glm::dvec3& to_light) const;
  [[nodiscard]] bool refracts() const { return solid_ && eta_ != 1.0; }
  [[nodiscard]] glm::dvec3 fresnel(double cosine, double dielectric) const;
  [[nodiscard]] glm::dvec3 fresnel_by_channel(double cosine, double dielectric) const;
  [[nodiscard]] glm::dvec3 fresnel_of_facets(double cosine, double dielectric) const;
  [[nodiscard]] double below(const glm::dvec3& to_light, double dielectric) const;
  [[nodiscard]] double distribution(const glm::dvec3& half) const;
  [[nodiscard]] double shadowing(double normal_light) const;
  [[nodiscard]] std::optional<Facet> facet(Lobe lobe, const glm::dvec3& to_light) const;
  [[nodiscard]] double sampled_normals(Lobe lobe) const;
  [[nodiscard]] double facet_pdf(Lobe lobe, const Facet& facet) const;
  [[nodiscard]] std::optional<glm::dvec3> refracted(const glm::dvec3& normal) const;
  [[nodiscard]] std::optional<BsdfSample> sample_diffuse(const glm::dvec2& u) const;
  [[nodiscard]] std::optional<BsdfSample> sample_facet(Lobe lobe, const glm::dvec2& u) const;
  [[nodiscard]] std::optional<BsdfSample> sample_single(Lobe lobe) const;
  [[nodiscard]] std::optional<BsdfSample> sample_channels(const glm::dvec2& u) const;

  glm::dvec3 view_{0.0};
  glm::dvec3 normal_{0.0};
  glm::dvec3 geometric_normal_{0.0};
  glm::dvec3 base_color_{0.0};
  glm::dvec3 tint_{0.0};  ///< of light let through, metal and share of transmission included
  double normal_view_ = 0.0;
  double bounded_view_ = 0.0;  ///< the cosine to the viewer, bounded as that of sampled facets is
  double view_smith_ = 1.0;    ///< sqrt(alpha^2 + (1 - alpha^2) (n.v)^2)
  double roughness_ = 1.0;
  double alpha2_ = 1.0;
  double metallic_ = 0.0;
  double diffuse_ = 0.0;      ///< share of light that has a chance to be scattered by the base
  double view_enters_ = 0.0;  ///< where it transmits in part: 1 - F(n.v), over its mean from outside
  double f0_ = 0.04;          ///< of the dielectric, looked at straight
  double eta_ = 1.5;          ///< index behind the surface over the index before it
  double squeeze_ = 1.0;      ///< of what is carried by refraction: 1 / eta^2 for radiance
  bool solid_ = false;
  bool exact_ = false;       ///< Fresnel's equations in place of Schlick's
  bool reflects_ = true;     ///< has a specular layer at all
  bool all_mirror_ = false;  ///< an index of 0
  bool unlit_ = false;
  bool scatters_ = true;  ///< neither unlit nor seen edge-on
  LobeSet present_ = 0;
  LobeSet delta_ = 0;  ///< those that would have a single direction, present or not
  /// Each channel's alone, for its transmission, where they share directions; else null.
  std::shared_ptr<const std::array<Bsdf, 3>> channels_;
  std::shared_ptr<const ExtendedBsdf> extended_;  ///< stands for all of this where the material has extensions
};

}  // namespace hpr
