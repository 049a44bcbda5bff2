#pragma once

#include <span>

#include "engine/checkpoint.h"
#include "engine/frame.h"
#include "engine/render_settings.h"

namespace hpr {

/// What decides the bits of a frame: this program, the scene, the views, how they are sampled and lit (every setting
/// that says so in the table); and what is kept of it beside the picture. `settings` are resolved.
[[nodiscard]] RunIdentity identity_of(const Session& session, const FramePlan& plan, std::span<const View> views,
                                      const RenderSettings& settings, bool keeps_keys);

/// What made the keys of such a run; Auto where it does not say.
[[nodiscard]] Primary primary_of(const RunIdentity& identity);

}  // namespace hpr
