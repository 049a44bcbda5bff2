#include "tools/compare/distributions/frame_prediction.h"

namespace hpr {

std::optional<double> predict_frame_ms(Session& /*session*/, const FramePlan& /*plan*/) {
  return std::nullopt;
}

}  // namespace hpr
