#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "scene/position_map.h"

namespace hpr {

/// A PFM of three channels (Debevec's portable float map: "PF", width and height, a scale whose sign tells the byte
/// order, then rows from the bottom up): per texel a point in metres, wall space; NaN or infinite where no light falls.
/// Throws Error (BadInput) with `name`: no such file, a length that does not fit, no point at all, points beyond a
/// thousand kilometres.
[[nodiscard]] PositionMap parse_position_map(std::span<const std::byte> bytes, const std::string& name);

}  // namespace hpr
