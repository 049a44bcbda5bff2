#pragma once

#include <string>
#include <string_view>

#include "compositing/model/recorded_frame.h"

namespace hpr {

/// An SVG of who sends what to whom: ranks are rows, rounds are columns, first those of compositing, then those of
/// collecting the frame on rank 0. Arrows are as wide as their messages are large; below each column stands how many
/// there are of what size. `name`: of the strategy, for the text alternative.
[[nodiscard]] std::string draw_schedule(std::string_view name, const RecordedFrame& frame);

}  // namespace hpr
