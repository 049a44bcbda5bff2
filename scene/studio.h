#pragma once

#include <string_view>

#include "scene/scene.h"

namespace hpr {

/// Light for scenes that bring none: a grey room without walls, darker below than above, whose horizon is a calm
/// backdrop, with four soft lamps well above it. Radiances, in the directions of Environment:
///
///     straight down 0.2, the horizon 0.35, straight up 0.7
///     key lamp 3.2, to the upper left of a viewer at +z; fill lamp 1.4, to the right; ceiling lamp 1; rim lamp 2.4,
///     behind
///
/// A white matte surface that faces up is about as bright as radiance 1, one that faces +z, a viewer, 0.65.
[[nodiscard]] Environment make_studio();
inline constexpr std::string_view kStudioName = "studio";

}  // namespace hpr
