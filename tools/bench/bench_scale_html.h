#pragma once

#include <string>

#include "tools/bench/bench_scale_report.h"

namespace hpr {

/// SVG: speed-up over cores, both logarithmic, a line for each wall and number of threads, beside what is linear.
[[nodiscard]] std::string plot_speed_up(const ScaleReport& report);

/// The report as one HTML document, which is well-formed XML too: what was measured where, the plot and all runs. It
/// needs no script, no other file and no network. `report.runs` is not empty.
[[nodiscard]] std::string scale_html(const ScaleReport& report);

}  // namespace hpr
