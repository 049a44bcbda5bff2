#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "app/doctor/doctor.h"
#include "tools/compare/compare.h"
#include "tools/compare/schedule_drawing.h"
#include "tools/report/table.h"

namespace hpr {

/// What was compared, where and how.
struct CompareSubject {
  std::string command;  ///< as the user could type it again
  Machine machine;
  Size screen;
  Size grid;
  std::string input;
  std::string operation = "nearest";  ///< nearest, over8 or overf
  std::uint64_t seed = 1;
};

/// The line above a table for people.
[[nodiscard]] std::string compare_headline(const CompareSubject& subject, bool oversubscribed);
/// A document of schema hpr.compare/1 with these runs.
[[nodiscard]] std::string compare_document(const CompareSubject& subject, bool oversubscribed, Json runs);
/// A page's heading: the subject, `further` facts, the commit and the command; with a warning where a run is
/// oversubscribed.
[[nodiscard]] std::string compare_heading(std::string_view title, const CompareSubject& subject, bool oversubscribed,
                                          std::vector<Fact> further);

/// Everything `hpr compare` prints about strategies.
struct CompareReport : CompareSubject {
  std::vector<CompareRun> runs;

  /// Whether any run has more ranks than cores: its times then show how the cores were shared as much as what a
  /// strategy costs.
  [[nodiscard]] bool oversubscribed() const;
};

/// The columns of runs: in reports, and as an MPI job hands runs over to the process that started it.
[[nodiscard]] const std::vector<Column<CompareRun>>& compare_columns();

/// A table for people.
[[nodiscard]] std::string compare_table(const CompareReport& report);
/// Schema hpr.compare/1.
[[nodiscard]] std::string compare_json(const CompareReport& report);
/// One line per run below a line of column names.
[[nodiscard]] std::string compare_csv(const CompareReport& report);
/// The report as one HTML document, which is well-formed XML too: what was measured where, plots, all runs and the
/// drawings. It needs no script, no other file and no network. `report.runs` is not empty.
[[nodiscard]] std::string compare_html(const CompareReport& report, const std::vector<StrategyDrawing>& drawings);

/// An SVG plot of median times over ranks, both logarithmic: a line per strategy, whiskers from min to p95, predictions
/// as hollow marks. A strategy has its own color, mark and dashes, and its name beside it, so that nothing depends on
/// color alone. `runs` are not empty.
[[nodiscard]] std::string plot_time_over_ranks(const std::vector<CompareRun>& runs);
/// An SVG plot of median times against bytes sent, both logarithmic, in the styles of plot_time_over_ranks: a mark per
/// run of several ranks with their number; runs that send nothing stand at the left. `runs` are not empty.
[[nodiscard]] std::string plot_time_against_bytes(const std::vector<CompareRun>& runs);

}  // namespace hpr
