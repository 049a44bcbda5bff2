#pragma once

#include <string>

#include "tools/tradeoff/tradeoff.h"

namespace hpr {

/// The sweep as one HTML page: error over time by every metric, where the time goes, a part of every picture with what
/// is seen to be wrong in it, and the table. `report.points` is not empty.
[[nodiscard]] std::string tradeoff_html(const TradeoffReport& report);

}  // namespace hpr
