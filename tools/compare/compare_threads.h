#pragma once

#include <chrono>
#include <string>

#include "tools/compare/compare.h"

namespace hpr {

/// compare_strategies with `ranks` threads of this process as ranks, on a simulated cluster (parse_simulation) unless
/// `simulate` is empty.
[[nodiscard]] CompareResult compare_on_threads(int ranks, const std::string& simulate,
                                               std::chrono::nanoseconds hang_timeout, const CompareInput& input,
                                               const CompareSettings& settings);

}  // namespace hpr
