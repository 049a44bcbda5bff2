#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "walls/config/wall.h"

namespace hpr {

/// The sides of a screen, as its viewer sees them.
enum class Side { Left, Right, Up, Down };

/// Per side the screen that goes on there: whose facing edge is nearest, up to a third of a screen away; also around
/// the corners of a curved wall. Screens for the other eye are none.
[[nodiscard]] std::array<std::optional<std::size_t>, 4> adjacent_screens(const Wall& wall, std::size_t screen);

}  // namespace hpr
