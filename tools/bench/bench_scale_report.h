#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "app/doctor/doctor.h"
#include "tools/bench/bench_scale.h"

namespace hpr {

/// What `hpr bench scale` found.
struct ScaleReport {
  std::string command;  ///< that makes the same measurement again
  Machine machine;
  std::string input;
  Size size;  ///< pixels of a screen
  std::uint64_t seed = 1;
  std::vector<ScaleRun> runs;

  /// Whether some run has more threads, on each of its hosts, than that has cores.
  [[nodiscard]] bool oversubscribed(const ScaleRun& run) const;
};

/// What a run's frames say, against the least cores of the same wall.
struct ScaleFigures {
  double median_ms = 0.0;
  double low_ms = 0.0;  ///< with `high_ms` a 95 % interval of the median, from the order of the frames' times
  double high_ms = 0.0;
  double speed_up = 1.0;
  double efficiency = 1.0;  ///< speed-up for each core more
  double imbalance = 1.0;   ///< busiest rank / mean
};
[[nodiscard]] ScaleFigures figures_of(const ScaleReport& report, const ScaleRun& run);

/// One sentence for each rank that is busy for more than 1.5 times as long as the middle one of its run.
[[nodiscard]] std::vector<std::string> slow_ranks(const ScaleReport& report);

/// Whether all runs of a wall made the same picture.
[[nodiscard]] bool pictures_agree(const ScaleReport& report);

/// In the shape of the thesis's table 6.1: cores of a rank, ranks, hosts, time, speed-up.
[[nodiscard]] std::string scale_table(const ScaleReport& report);
/// Schema hpr.bench-scale/1.
[[nodiscard]] std::string scale_json(const ScaleReport& report);
/// One line per frame under a line of column names.
[[nodiscard]] std::string scale_csv(const ScaleReport& report);

}  // namespace hpr
