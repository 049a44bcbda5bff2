#pragma once

#include <string>
#include <vector>

#include "tools/compare/compare_report.h"
#include "tools/compare/distributions/distribution_run.h"

/// The reports of `hpr compare --distribute`.
namespace hpr {

struct DistributionReport : CompareSubject {
  std::vector<DistributionRun> runs;  ///< not empty

  /// Whether any run has more ranks than cores.
  [[nodiscard]] bool oversubscribed() const;
  /// Whether all runs made the reference's keys and colors.
  [[nodiscard]] bool frames_agree() const;
};

/// A table for people.
[[nodiscard]] std::string distribution_table(const DistributionReport& report);
/// Schema hpr.compare/1.
[[nodiscard]] std::string distribution_json(const DistributionReport& report);
/// One line per run below a line of column names.
[[nodiscard]] std::string distribution_csv(const DistributionReport& report);
/// The report as one HTML document, which is well-formed XML too: what was measured where, plots and all runs. It needs
/// no script, no other file and no network.
[[nodiscard]] std::string distribution_html(const DistributionReport& report);

/// SVG: a bar per run, by numbers of ranks, of the medians of a frame's stages one after the other; a mark at the
/// median of the whole frame, whiskers from the fastest to the 95th percentile, a hollow mark at what was predicted.
/// Every part that is wide enough has its name, so that nothing depends on color alone.
[[nodiscard]] std::string plot_stages(const DistributionReport& report);
/// SVG: a bar per run of the largest peak of memory of its ranks.
[[nodiscard]] std::string plot_memory(const DistributionReport& report);

}  // namespace hpr
