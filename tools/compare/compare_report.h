#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "app/doctor/doctor.h"
#include "tools/compare/compare.h"

namespace hpr {

/// Everything `hpr compare` prints.
struct CompareReport {
  std::string command;  ///< as the user could type it again
  Machine machine;
  Size screen;
  Size grid;
  std::string input;
  std::string operation = "nearest";  ///< nearest, over8 or overf
  std::uint64_t seed = 1;
  std::vector<CompareRun> runs;

  /// More ranks than cores in any run: its times say how the cores were shared as much as what a strategy costs.
  [[nodiscard]] bool oversubscribed() const;
};

/// A table for people.
[[nodiscard]] std::string compare_table(const CompareReport& report);
/// Schema hpr.compare/1.
[[nodiscard]] std::string compare_json(const CompareReport& report);
/// One line per run under a line of column names (RFC 4180, but for its line ends).
[[nodiscard]] std::string compare_csv(const CompareReport& report);

/// Runs as one JSON document on one line, and back: how an MPI job hands its runs to the process that started it.
/// Throws Error (Internal) when `text` is no such document.
[[nodiscard]] std::string runs_to_json(const std::vector<CompareRun>& runs);
[[nodiscard]] std::vector<CompareRun> runs_from_json(std::string_view text);

}  // namespace hpr
