#pragma once

#include <optional>
#include <span>

namespace hpr {

class Session;
struct FramePlan;
struct View;

/// Collective. What a frame of this plan is expected to take, in ms on the slowest rank, as all ranks agree: by
/// predict_frame, with OpenGL's speed as measured on all ranks at once, and what keys by rays and light took in frames
/// before, whoever made them. `samples`: of the frame. None where light was not measured, or the model has no such
/// frames: of scenes in parts, and of light before compositing.
[[nodiscard]] std::optional<double> predict_frame_ms(Session& session, const FramePlan& plan,
                                                     std::span<const View> views, int samples);

}  // namespace hpr
