#include "tools/bench/bench_rows.h"

#include <fmt/format.h>
#include <hpr/version.h>

#include <algorithm>

#include "core/json.h"

namespace hpr {

void print_bench(const std::vector<BenchRow>& rows, const std::string& machine, bool json) {
  if (!json) {
    std::size_t width = 44;
    for (const BenchRow& row : rows) width = std::max(width, row.name.size());
    fmt::print("{:<{}} {:>10} {:>10} {:<6} {:>6}\n", "", width, "ours", "floor", "", "ratio");
    for (const BenchRow& row : rows) {
      if (row.floor > 0.0) {
        fmt::print("{:<{}} {:>10.2f} {:>10.2f} {:<6} {:>6.2f}\n", row.name, width, row.ours, row.floor, row.unit,
                   row.ratio);
      } else {
        fmt::print("{:<{}} {:>10.2f} {:>10} {:<6} {:>6}\n", row.name, width, row.ours, "-", row.unit, "-");
      }
    }
    return;
  }
  Json document{{"schema", "hpr.bench/1"}, {"machine", machine}, {"commit", kCommit}, {"rows", Json::array()}};
  for (const BenchRow& row : rows) {
    const auto known = [&](double value) { return row.floor > 0.0 ? Json(value) : Json(); };
    document["rows"].push_back({{"name", row.name},
                                {"ours", row.ours},
                                {"floor", known(row.floor)},
                                {"unit", row.unit},
                                {"ratio", known(row.ratio)}});
  }
  fmt::print("{}\n", document.dump(2));
}

}  // namespace hpr
