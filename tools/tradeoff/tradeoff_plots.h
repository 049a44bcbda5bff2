#pragma once

#include <string>

#include "tools/tradeoff/tradeoff.h"

namespace hpr {

/// SVG plots of a sweep's points, which are not empty and bear the numbers of their rows in the table, from 1.

/// Error by `metric` over time, both logarithmic. Points that differ in the last knob alone are joined; the front is
/// filled. Empty where no point has an error above 0 by this metric.
[[nodiscard]] std::string plot_error_over_time(const TradeoffReport& report, const std::string& metric);

/// A bar for each point: the shares of its passes in its time.
[[nodiscard]] std::string plot_shares_of_passes(const TradeoffReport& report);

}  // namespace hpr
