#pragma once

#include <string>
#include <vector>

#include "tools/compare/compare.h"

namespace hpr {

/// SVG plots of runs, which are not empty. A strategy has the same colour, mark and dashes in both, and its name beside
/// it, so that nothing hangs on colour alone. Scales are logarithmic.

/// Median time over ranks, a line per strategy, whiskers from min to p95, predictions as hollow marks.
[[nodiscard]] std::string plot_time_over_ranks(const std::vector<CompareRun>& runs);

/// Median time against bytes sent, one mark per run of several ranks with their number; runs that send nothing stand at
/// the left.
[[nodiscard]] std::string plot_time_against_bytes(const std::vector<CompareRun>& runs);

}  // namespace hpr
