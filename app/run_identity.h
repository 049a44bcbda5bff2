#pragma once

#include <span>

#include "app/checkpoint.h"
#include "app/frame.h"

namespace hpr {

/// What decides the bits of a frame: this program, the scene, the views, how they are sampled and lit.
[[nodiscard]] RunIdentity identity_of(const Session& session, const FramePlan& plan, std::span<const View> views,
                                      const Sampling& sampling);

}  // namespace hpr
