#pragma once

#include <string>
#include <vector>

#include "tools/compare/compare_report.h"

namespace hpr {

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

/// The report as one HTML document, which is well-formed XML too: what was measured where, plots, all runs and the
/// drawings. It needs no script, no other file and no network. `report.runs` is not empty.
[[nodiscard]] std::string compare_html(const CompareReport& report, const std::vector<StrategyDrawing>& drawings);

}  // namespace hpr
