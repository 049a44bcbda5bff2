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

/// Whether a scene brings too little light: it has no lights and no environment, and what its surfaces emit is too
/// little for its size; see emitted_radiance and kLitRadiance.
[[nodiscard]] bool needs_studio(const Scene& scene);

/// The radiance of a white matte surface on which all that the scene's surfaces emit falls evenly: their power, over pi
/// times the area of the sphere about the scene.
[[nodiscard]] double emitted_radiance(const Scene& scene);

/// From so much emitted_radiance on emitters are the scene's lamps: about five stops below white.
inline constexpr double kLitRadiance = 0.03;

}  // namespace hpr
