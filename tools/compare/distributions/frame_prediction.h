#pragma once

#include <optional>
#include <span>

namespace hpr {

class Session;
struct FramePlan;
struct View;

/// Collective. What a frame of this plan is expected to take, in ms on the slowest rank, as all ranks agree: by
/// predict_frame, with speeds as measured on all ranks at once, and what keys by rays and light took in frames before,
/// whoever made them. `samples`: of the frame. `rest_ms`: what a frame before took on this rank beside its stages, and
/// to bring tiles to screens, which every distribution does alike; the least of the ranks' counts, as the rest of it is
/// waiting. None where light was not measured, or the model has no such frames: of scenes in parts, and of light before
/// compositing.
[[nodiscard]] std::optional<double> predict_frame_ms(Session& session, const FramePlan& plan,
                                                     std::span<const View> views, int samples, double rest_ms);

}  // namespace hpr
