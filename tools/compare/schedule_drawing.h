#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "compositing/model/recorded_frame.h"
#include "tools/compare/compare.h"

namespace hpr {

/// An SVG of who sends what to whom: ranks are rows, rounds are columns, first those of compositing, then those of
/// collecting the frame on rank 0. Arrows are as wide as their messages are large; below each column stands how many
/// there are of what size. `name`: of the strategy, for the text alternative.
[[nodiscard]] std::string draw_schedule(std::string_view name, const RecordedFrame& frame);

/// What a strategy does with a frame, recorded from it.
struct StrategyDrawing {
  std::string strategy;
  int ranks = 0;       ///< that it is drawn on
  std::string svg;     ///< of draw_schedule; empty when it is not drawn
  std::string remark;  ///< why not
};

/// One per strategy of `runs`, on the largest number of ranks compared but 16 at most, which is as much as a drawing
/// shows. Runs the strategies on threads.
[[nodiscard]] std::vector<StrategyDrawing> draw_strategies(const std::vector<CompareRun>& runs);

}  // namespace hpr
