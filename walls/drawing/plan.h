#pragma once

#include <string>

#include "image/color.h"
#include "image/image.h"
#include "walls/config/wall.h"
#include "walls/drawing/heat.h"

namespace hpr {

/// The plan of a wall, for people: its screens as they stand, to scale, with their ids, sizes in pixels and
/// millimetres and owners (host, rank, window), gaps hatched, and the wall from above with its viewer.
/// Both forms come from the same drawing code.
/// With `heat` screens are coloured by what a run measured of them instead of by their owners, and a scale tells how.
[[nodiscard]] std::string wall_plan_svg(const Wall& wall, const WallHeat* heat = nullptr);
[[nodiscard]] Image<Rgba8> wall_plan_image(const Wall& wall, const WallHeat* heat = nullptr);

/// "pc (localhost), rank 0", "rank 2", or "any rank".
[[nodiscard]] std::string owner_of(const Wall& wall, const WallScreen& screen);

}  // namespace hpr
