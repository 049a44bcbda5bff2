#pragma once

#include <span>
#include <string>
#include <vector>

#include "engine/frame.h"
#include "rt/deferred_shader.h"

namespace hpr {

/// What a frame of these settings may do without, in the order in which it is given up: "half-resolution" of all passes
/// that have one, "photons", "glossy-cutoff" (and chains of reflections past the second). `passes`: those of the
/// frame's plan; what would save nothing is left out.
[[nodiscard]] std::vector<std::string> economies_of(const FrameSettings& settings, std::span<const PassPlan> passes);

/// The settings with these economies made.
[[nodiscard]] FrameSettings economize(FrameSettings settings, std::span<const std::string> economies);

}  // namespace hpr
