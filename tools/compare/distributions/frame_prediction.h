#pragma once

#include <optional>

namespace hpr {

class Session;
struct FramePlan;

/// Collective. What a frame of this plan is expected to take, in ms on the slowest rank, as all ranks agree; none where
/// there is nothing to reckon it from.
[[nodiscard]] std::optional<double> predict_frame_ms(Session& session, const FramePlan& plan);

}  // namespace hpr
