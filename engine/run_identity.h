#pragma once

#include <span>

#include "engine/checkpoint.h"
#include "engine/frame.h"

namespace hpr {

/// What decides the bits of a frame: this program, the scene, the views, how they are sampled and lit; and what is kept
/// of it beside the picture.
[[nodiscard]] RunIdentity identity_of(const Session& session, const FramePlan& plan, std::span<const View> views,
                                      const Sampling& sampling, bool keeps_keys);

/// What made the keys of such a run; Auto where it does not say.
[[nodiscard]] Primary primary_of(const RunIdentity& identity);

}  // namespace hpr
