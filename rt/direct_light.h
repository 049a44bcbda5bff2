#pragma once

#include <cstddef>

#include "rt/pass.h"

namespace hpr {

/// Lights are sampled so many at a time: the memory of a tile's samples does not grow with the scene's lights, and
/// stays in the second-level cache (64 bytes a sample, 4096 points). Sums are the same as for all lights at once.
inline constexpr std::size_t kLightsAtOnce = 8;

/// Adds what the points of `wave` emit to the tile's radiance.
void add_emission(TileWork& tile, const Wave& wave);

/// Replaces the samples of `wave` by those of up to kLightsAtOnce lights from `first_light` on: what each would add if
/// nothing stood in its way.
void sample_lights(const TileWork& tile, std::size_t first_light, Wave& wave);

/// Adds the samples still visible to the tile's radiance.
void add_samples(TileWork& tile, const Wave& wave);

}  // namespace hpr
