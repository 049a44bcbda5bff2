#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>

#include "rt/bsdf.h"

namespace hpr {

/// Photons a gather has found, side by side: to be looked at together.
struct FoundPhotons {
  static constexpr std::size_t kMost = 256;  ///< a multiple of what reflect_photons takes at once

  std::size_t count = 0;
  // Unset beyond `count`.
  std::array<std::uint32_t, kMost> direction;  ///< packed: towards where each came from
  std::array<float, kMost> weight;
  std::array<std::array<float, kMost>, 3> flux;  ///< [channel], W
};

/// The sum of weight * flux * f over the photons found, f being what `terms` say, in single precision; sums run in an
/// order that no processor changes. Where the shading normal `leans`, f is made of light that falls on the true surface
/// as if it fell on the one that normal pretends. May write beyond `count`.
[[nodiscard]] glm::dvec3 reflect_photons(const ReflectionTerms& terms, bool leans, FoundPhotons& photons);

}  // namespace hpr
