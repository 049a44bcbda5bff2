#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>

#include "rt/materials/anisotropic_facets.h"
#include "rt/materials/bsdf.h"
#include "rt/materials/material_point.h"
#include "rt/materials/sheen.h"
#include "rt/trace/surfaces.h"

namespace hpr {

/// How a surface with material extensions scatters: what Bsdf says of a plain one, changed as the glTF extensions say.
///
/// - specular: the dielectric's term is specular * (f0 + (1 - f0) s), f0 = min(f0 of its index * colour, 1), s running
///   from 0 to 1 as Schlick's term or Fresnel's equations do. What it leaves, 1 less the term's brightest channel, is
///   the base's. An index of 1 reflects nothing still.
/// - iridescence: thin_film_fresnel in the place of both terms, the dielectric's and the metal's, by its factor.
/// - anisotropy: AnisotropicFacets reflect, unless the surface lets light through undiffused.
/// - diffuse transmission: its share of the diffuse light leaves on the other side, of its own colour.
/// - sheen: a part of the diffuse lobe. All below it is scaled by 1 - max(colour) E of the viewer's or of the light's
///   cosine, the less of them (KHR_materials_sheen), E being sheen_albedo.
/// - clearcoat: a lobe of its own, GGX of index 1.5, and 1 - clearcoat F of all below, F being Schlick's term at the
///   coat's normal: as with sheen, the less of both directions' counts, which makes it reciprocal where the extension's
///   own formula knows the viewer alone. The inner side of a solid has no coat.
///
/// Values of the coat hold the quotient of its cosine to the light and the material's own, by which they are
/// multiplied. What the extensions add never gives back more than arrives: a plain surface that does not stays so.
class ExtendedBsdf {
 public:
  /// `material` has extensions.
  ExtendedBsdf(const MaterialPoint& material, const SurfacePoint& surface, Carried carried);
  /// The BSDF for another viewer on the same side, of whom the coat has the normal too.
  [[nodiscard]] ExtendedBsdf seen_from(const glm::dvec3& to_viewer, const glm::dvec3& normal) const;

  /// Each as Bsdf's.
  [[nodiscard]] glm::dvec3 value(Lobe lobe, const glm::dvec3& to_light) const;
  [[nodiscard]] double pdf(Lobe lobe, const glm::dvec3& to_light) const;
  [[nodiscard]] std::optional<BsdfSample> sample(Lobe lobe, const glm::dvec2& u) const;
  [[nodiscard]] bool present(Lobe lobe) const;
  [[nodiscard]] glm::dvec3 weight(Lobe lobe) const;
  [[nodiscard]] bool is_delta(Lobe lobe) const;
  [[nodiscard]] double coat_roughness() const { return extensions_.clearcoat_roughness; }

 private:
  [[nodiscard]] double normal_to(const glm::dvec3& direction) const;
  [[nodiscard]] bool same_side(const glm::dvec3& to_light) const;
  [[nodiscard]] bool other_side(const glm::dvec3& to_light) const;
  [[nodiscard]] bool is_within(const glm::dvec3& direction) const;
  [[nodiscard]] bool is_exact() const { return material_.transmission > 0.0 && material_.ior > 0.0; }
  [[nodiscard]] double eta() const;
  [[nodiscard]] glm::dvec3 dielectric(double cosine, double plain, double eta) const;
  [[nodiscard]] glm::dvec3 dielectric(double cosine) const;
  [[nodiscard]] glm::dvec3 fresnel(double cosine, double plain) const;
  [[nodiscard]] glm::dvec3 fresnel(double cosine) const;
  [[nodiscard]] double enters(double cosine) const;
  [[nodiscard]] double mean_entering() const;
  [[nodiscard]] double base_enters() const;
  [[nodiscard]] double below_coat(const glm::dvec3& direction) const;
  [[nodiscard]] double below_sheen(const glm::dvec3& direction) const;
  [[nodiscard]] double below_coat_both(const glm::dvec3& to_light) const;
  [[nodiscard]] double below_both(const glm::dvec3& to_light) const;
  [[nodiscard]] glm::dvec3 diffuse_value(const glm::dvec3& to_light) const;
  [[nodiscard]] double diffuse_enters(const glm::dvec3& to_light) const;
  [[nodiscard]] double diffuse_pdf(const glm::dvec3& to_light) const;
  [[nodiscard]] std::optional<BsdfSample> sample_diffuse(const glm::dvec2& u) const;
  [[nodiscard]] glm::dvec3 reflection_value(const glm::dvec3& to_light) const;
  [[nodiscard]] std::optional<BsdfSample> sample_reflection(const glm::dvec2& u) const;
  [[nodiscard]] double coat_quotient(const glm::dvec3& to_light) const;
  [[nodiscard]] std::optional<BsdfSample> sample_coat(const glm::dvec2& u) const;
  [[nodiscard]] double transmission_scale(const glm::dvec3& to_light) const;
  [[nodiscard]] std::optional<BsdfSample> sample_transmission(const glm::dvec2& u) const;
  [[nodiscard]] glm::dvec3 through_value(const glm::dvec3& to_light) const;
  [[nodiscard]] double through_enters(double cosine, bool on_viewers_side) const;
  [[nodiscard]] std::optional<BsdfSample> sample_through(const glm::dvec2& u) const;

  MaterialPoint material_;  ///< without its extensions
  ExtensionPoint extensions_;
  SurfacePoint surface_;
  Carried carried_;
  Bsdf plain_;   ///< the material without extensions
  Bsdf facets_;  ///< as rough, all reflecting
  Bsdf coat_;    ///< of full strength
  std::optional<AnisotropicFacets> anisotropic_;
  std::optional<Sheen> sheen_;
  double view_below_sheen_ = 1.0;  ///< below_sheen(to_viewer)
  double diffuse_ = 0.0;  ///< share of light that has a chance to be scattered by the base on the viewer's side
  double through_ = 0.0;  ///< on the other
  double f0_ = 0.04;
  double normal_view_ = 0.0;
  double view_enters_ = 1.0;  ///< enters(normal_view_)
  double sheen_chance_ = 0.0;
  bool scatters_ = false;
};

}  // namespace hpr
