#pragma once

#include <span>
#include <vector>

#include "scene/view.h"

namespace hpr {

/// Screens that one eye sees without a gap as parts of one picture: they lie in one plane, have one grid of pixels (to
/// a sixteenth of a pixel) and touch or overlap. Each becomes a block of the one screen that such a group spans, so
/// that filters go on from one to the other, on one grid and with one screen's noise. Its number is that of the group's
/// first screen. All other screens stay as they are. The order stays.
[[nodiscard]] std::vector<View> join_screens(std::span<const View> screens);

}  // namespace hpr
