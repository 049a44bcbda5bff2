#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>

#include "rt/materials/bsdf.h"
#include "rt/photons/photon_search.h"

namespace hpr {

/// The light of a photon of a map.
struct PhotonLight {
  std::uint32_t direction = 0;  ///< packed: towards where it came from
  std::array<float, 3> flux{};  ///< in the map's unit
};
static_assert(sizeof(PhotonLight) == 16);

/// The sum of weight * flux * f over the photons found, f being what `terms` say, in single precision; sums run in an
/// order that no processor changes. Where the shading normal `leans`, f is made of light that falls on the true surface
/// as if it fell on the one that normal pretends. Writes beyond `found.count`, where find_photons has left room.
[[nodiscard]] glm::dvec3 reflect_photons(const ReflectionTerms& terms, bool leans, const PhotonLight* lights,
                                         FoundPhotons& found);

}  // namespace hpr
