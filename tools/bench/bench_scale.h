#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "app/doctor/doctor.h"
#include "app/options/globals.h"
#include "app/options/render_options.h"
#include "image/image.h"
#include "tools/report/table.h"

/// How frames scale with ranks and threads: the measurement and the report of `hpr bench scale`.
namespace hpr {

/// What is drawn, whoever draws it.
struct ScaleInput {
  std::string scene;
  RenderSettings settings;  ///< resolved
  Size size;                ///< pixels of a screen
  std::vector<Size> grids;  ///< walls: screens side by side and one above the other
  int warmup = 1;           ///< frames before those that are measured
};

/// In place of the hash of frames that were not alike.
inline constexpr const char* kDiffering = "differs from job to job";

/// The frames of one wall by one size of job, as the slowest rank took them.
struct ScaleRun {
  Size grid;
  int ranks = 1;
  int threads = 1;  ///< of each rank
  int hosts = 1;
  int gpus = 0;            ///< that OpenGL draws by; 0: CPUs do its work, or rays make the keys
  std::vector<double> ms;  ///< per frame, from its first triangle to its last tile on a screen
  /// Per rank the median of the time it spends on keys and light, without compositing and bringing pixels to screens;
  /// of several jobs the least. Where photons are sent, that includes waiting for those of the others.
  std::vector<double> rank_ms;
  std::uint64_t bytes_sent = 0;  ///< of one frame, by all ranks
  std::string frame_xxh64;       ///< of the screen's RGBA8 pixels; of several screens' hashes in their order
};

/// Collective. Draws each wall `frames` times, every time the same frame. The runs stand on rank 0.
[[nodiscard]] std::vector<ScaleRun> measure_scale(Communicator& comm, const Globals& globals, const ScaleInput& input,
                                                  int frames);

/// The columns of runs as an MPI job hands them over to the process that started it.
[[nodiscard]] const std::vector<Column<ScaleRun>>& scale_job_columns();

/// Appends the frames of another job of the same size: `more` has the walls of `runs` in their order.
void append_frames(std::vector<ScaleRun>& runs, std::vector<ScaleRun> more);

/// What `hpr bench scale` found.
struct ScaleReport {
  std::string command;  ///< that makes the same measurement again
  Machine machine;
  std::string input;
  Size size;  ///< pixels of a screen
  std::uint64_t seed = 1;
  std::vector<ScaleRun> runs;

  /// Whether a run has more threads, on each of its hosts, than that has cores.
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

/// A table in the shape of the thesis's table 6.1: cores of a rank, ranks, GPUs, hosts, time, speed-up.
[[nodiscard]] std::string scale_table(const ScaleReport& report);
/// Schema hpr.bench-scale/1.
[[nodiscard]] std::string scale_json(const ScaleReport& report);
/// One line per frame under a line of column names.
[[nodiscard]] std::string scale_csv(const ScaleReport& report);

/// SVG: speed-up over cores, both logarithmic, a line for each wall and number of threads, beside what is linear.
[[nodiscard]] std::string plot_speed_up(const ScaleReport& report);
/// The report as one HTML document, which is well-formed XML too: what was measured where, the plot and all runs. It
/// needs no script, no other file and no network. `report.runs` is not empty.
[[nodiscard]] std::string scale_html(const ScaleReport& report);

}  // namespace hpr
