#pragma once

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
[[nodiscard]] bool is_followed(const Bsdf& bsdf, Lobe lobe, double glossy_cutoff);

/// Whether the eye's paths follow reflections of anything in the scene, as far as its least roughness tells.
[[nodiscard]] bool follows_reflections(const Requirements& scene, double glossy_cutoff);

/// Whether light that photons bring may show on anything in the scene, as far as its materials tell.
[[nodiscard]] bool may_take_photons(const Requirements& scene, double glossy_cutoff);

/// Whether some lobe is not.
[[nodiscard]] bool takes_photons(const Bsdf& bsdf, double glossy_cutoff);

/// The radiance towards the viewer that the lobes not followed make of the photons about `surface`. `bsdf` is of that
/// surface with the normal `shading_normal`, and carries radiance. Never NaN. `found` is overwritten.
[[nodiscard]] glm::dvec3 gather_photons(const PhotonMap& map, const SurfacePoint& surface, const Bsdf& bsdf,
                                        const glm::dvec3& shading_normal, double glossy_cutoff, FoundPhotons& found);

}  // namespace hpr
