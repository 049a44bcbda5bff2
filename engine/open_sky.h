#pragma once

#include <optional>
#include <span>

#include "engine/session.h"

namespace hpr {

/// From so much of open sky on rays bring indirect light: with less noise than photons in the same time where spheres
/// hang in the open, and with more in a room with a hole (docs/decisions/0009-even-skies-are-gathered.md).
inline constexpr double kOpenSky = 0.5;

/// Collective. How much of the sky's light reaches the surfaces that some views see, as about a thousand rays find out:
/// of what would without anything in its way. None where the views see no surface. The same on all ranks, however the
/// scene is shared out.
[[nodiscard]] std::optional<double> open_sky(Session& session, const RaySettings& settings,
                                             std::span<const View> views);

}  // namespace hpr
