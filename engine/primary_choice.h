#pragma once

#include <span>
#include <string>

#include "engine/frame.h"

namespace hpr {

/// Collective. Sets `plan.primary` to what makes the keys sooner, on the slowest rank: each draws its share both ways,
/// all of it by OpenGL (whose work with vertices does not shrink with the area) and every seventh tile by rays, twice,
/// and the quicker try counts. What both need but once (uploads, Embree's scene, shaders) is left out, as it would be
/// in a run of frames. Returns why, with both times.
[[nodiscard]] std::string choose_primary(Session& session, FramePlan& plan, std::span<const View> views);

}  // namespace hpr
