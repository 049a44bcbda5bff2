#pragma once

#include <cstdint>
#include <glm/vec3.hpp>

#include "rt/materials/bsdf.h"
#include "rt/photons/photon_map.h"
#include "rt/trace/surfaces.h"
#include "scene/requirements.h"

/// How light is shared out between the eye's paths and photon maps. Wherever a path from the eye arrives:
///
/// - followed lobes are followed by rays, whatever they meet;
/// - all other lobes get their indirect light, light that has been scattered before, from photons.
///
/// (Emission, and direct light by sampling lights, is the eye's business too.) So a photon is kept wherever it arrives
/// on a surface with a lobe that is not followed, unless it comes straight from its light.
namespace hpr {

/// Whether the eye's paths follow this lobe: reflection of a roughness below `glossy_cutoff`, or in one direction only;
/// transmission always, as what lies behind a surface is seldom what lights it.
[[nodiscard]] inline bool is_followed(const Bsdf& bsdf, Lobe lobe, double glossy_cutoff) {
  if (lobe == Lobe::Transmission || lobe == Lobe::DiffuseTransmission) return true;
  return lobe != Lobe::Diffuse && (bsdf.roughness(lobe) < glossy_cutoff || bsdf.is_delta(lobe));
}

/// Whether the eye's paths follow reflections of anything in the scene, judged by its least roughness.
[[nodiscard]] bool follows_reflections(const Requirements& scene, double glossy_cutoff);

/// Whether light that photons bring may show on anything in the scene, judged by its materials.
[[nodiscard]] bool may_take_photons(const Requirements& scene, double glossy_cutoff);

/// Whether some lobe is not followed and so takes photons.
[[nodiscard]] bool takes_photons(const Bsdf& bsdf, double glossy_cutoff);

/// Photons about a place on a surface, in ray space.
struct PhotonSearch {
  glm::dvec3 position{0.0};
  glm::dvec3 in_cell{0.0};  ///< where in its cell it lies, each in [0, 1)
  std::uint32_t cell = 0;   ///< where that would be in the order of cells, not yet wrapped around
  std::uint32_t row_step = 0;
  std::uint32_t layer_step = 0;
  std::uint32_t last_slot = 0;  ///< as many slots as a power of two, less one
  glm::dvec3 normal{0.0};       ///< of the surface, unit length
  std::uint8_t layer = 0;       ///< photons of this layer count,
  double radius2 = 0.0;         ///< photons count that lie nearer than its root,
  double inverse_radius2 = 0.0;
  double cells_per_unit = 0.0;
  double flatness = 0.0;     ///< so much off the plane at the most,
  double min_cosine2 = 0.0;  ///< and on surfaces whose normal has a cosine to this one of at least its root
};

/// Finds the photons that count in the 3 x 3 rows of cells about a place, with Epanechnikov's weight 1 - d^2 / r^2: row
/// after row, cut to the cells that come within the radius and within the flatness of the plane. Cell x of row y of
/// layer z stands at slot (x + y row_step + z layer_step) & last_slot; starts[slot] is where its photons begin in
/// `positions`, also for the first two slots behind the last. In single precision, in steps that no processor rounds
/// otherwise.
void find_photons(const PhotonSearch& search, const std::uint32_t* starts, const PhotonPlace* positions,
                  FoundPhotons& found);

/// The sum of weight * flux * f over the photons found, f being what `terms` say, in single precision; sums run in an
/// order that no processor changes. Where the shading normal `leans`, f is made of light that falls on the true surface
/// as if it fell on the one that normal pretends. Writes beyond `found.count`, where find_photons has left room.
[[nodiscard]] glm::dvec3 reflect_photons(const ReflectionTerms& terms, bool leans, const PhotonLight* lights,
                                         FoundPhotons& found);

/// The radiance towards the viewer that the lobes not followed make of the photons about `surface`. `bsdf` is of that
/// surface with the normal `shading_normal`, and carries radiance. Within `radius` metres, at most the map's own. Never
/// NaN. `found` is overwritten.
[[nodiscard]] glm::dvec3 gather_photons(const PhotonMap& map, double radius, const SurfacePoint& surface,
                                        const Bsdf& bsdf, const glm::dvec3& shading_normal, double glossy_cutoff,
                                        FoundPhotons& found);

}  // namespace hpr
