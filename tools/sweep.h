#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "app/doctor/doctor.h"
#include "app/options/globals.h"
#include "cluster/transport/communicator.h"
#include "core/error.h"
#include "core/json.h"
#include "core/timing.h"
#include "image/image.h"
#include "tools/report/table.h"

/// What all measurements share: repetitions in turns, medians and spreads, progress over cases, jobs that measure for
/// the process that started them, the files of a report, and how sizes and lists of counts are written.
namespace hpr {

/// Order statistics of repeated measurements.
struct Spread {
  double min = 0.0;
  double median = 0.0;
  double p95 = 0.0;  ///< by the nearest rank
  double max = 0.0;
};
/// `values` is not empty.
[[nodiscard]] Spread spread_of(std::vector<double> values);
/// The mean of the two middle values where there is an even number; `values` is not empty.
[[nodiscard]] double median(std::vector<double> values);

/// Time on a steady clock in ms.
[[nodiscard]] double wall_ms();

/// How often something is measured.
struct Repetitions {
  int warmup = 1;    ///< before those that count
  int measured = 1;  ///< those that count
};

/// Calls `measure(contender, counts)` for each of the contenders in turns, so that what disturbs the machine disturbs
/// all alike. `counts` is false while warming up.
template <typename Measure>
void measure_in_turns(std::size_t contenders, Repetitions repetitions, const Measure& measure) {
  for (int i = -repetitions.warmup; i < repetitions.measured; ++i) {
    for (std::size_t contender = 0; contender < contenders; ++contender) measure(contender, i >= 0);
  }
}

/// The cases 0, 1 .. of so many rounds: each round has all of them, in an order of its own by the seed, so that what
/// slows the machine for a while does not fall on one of them, and none always follows the same other one.
[[nodiscard]] std::vector<std::size_t> shuffled_rounds(std::size_t cases, int rounds, std::uint64_t seed);
/// Rounds of jobs, each with a part of the frames.
inline constexpr int kJobRounds = 3;
/// How many of `frames` are measured in a round: as many in each, one more in the first ones.
[[nodiscard]] inline int frames_of_round(int frames, int rounds, int round) {
  return frames / rounds + (round < frames % rounds ? 1 : 0);
}

/// Median times in ms of `clock`, one for each of `contenders`, which run in turns.
[[nodiscard]] std::vector<double> median_times(const std::vector<std::function<void()>>& contenders,
                                               Repetitions repetitions, double (*clock)() = wall_ms);

/// How a case of a sweep ended.
struct CaseResult {
  bool measured = true;  ///< false: its result was known
  bool stop = false;     ///< the sweep ends here
  bool failed = false;   ///< the sweep ends here, and this case does not count
};

/// The cases of a sweep and how progress is reported on stderr.
struct SweepSettings {
  std::string progress;  ///< as Progress takes it
  std::string what;      ///< names a case: "point"
  std::size_t cases = 0;
  bool time_left = false;  ///< whether progress estimates it
};

/// Measures cases 0, 1 .. one after the other. `name(i)` describes a case once it was measured. Returns whether all
/// were.
bool measure_cases(const SweepSettings& settings, const std::function<std::string(std::size_t)>& name,
                   const std::function<CaseResult(std::size_t)>& measure);

/// What the process that started this MPI job asks of it, in the environment variable `variable`; none outside such
/// jobs. Open MPI passes variables that begin with OMPI_ to other hosts.
[[nodiscard]] std::optional<std::string> job_request(const char* variable);

/// What a job that measures returned.
struct JobResult {
  ExitCode code = ExitCode::Done;
  std::string rows;  ///< what rank 0 handed over

  /// Whether the job came to its end; where it did not, its ranks have reported on stderr what went wrong.
  [[nodiscard]] bool measured() const { return code == ExitCode::Done || code == ExitCode::CheckFailed; }
};
/// Runs this program with `arguments` as an MPI job of `ranks` ranks, which finds `request` in job_request(variable).
[[nodiscard]] JobResult run_measuring_job(const Globals& globals, int ranks, const std::vector<std::string>& arguments,
                                          const char* variable, const std::string& request);
/// As run_measuring_job, in one process without MPI, whose threads may be ranks.
[[nodiscard]] JobResult run_measuring_process(const Globals& globals, const std::vector<std::string>& arguments,
                                              const char* variable, const std::string& request);
/// Prints rows for the process that started this job, as one line of JSON; rank 0 calls it.
template <typename Row>
void hand_over(const std::vector<Column<Row>>& columns, std::span<const Row> rows) {
  std::fputs((Table(columns, rows).json().dump() + "\n").c_str(), stdout);
}
[[noreturn]] void throw_nothing_handed_over(const JsonError& error);
/// The rows that a job handed over. Throws Error (Internal) where `text` holds none.
template <typename Row>
[[nodiscard]] std::vector<Row> rows_from_job(const std::vector<Column<Row>>& columns, std::string_view text) {
  try {
    return rows_from_json(columns, Json::parse(text));
  } catch (const JsonError& error) {
    throw_nothing_handed_over(error);
  }
}
/// Collective. Runs `body` on rank 0; all ranks return its result.
[[nodiscard]] ExitCode decide_on_root(Communicator& comm, const std::function<ExitCode()>& body);
/// Throws Error (Usage) unless `wanted`, as the list `text` of --ranks names it, is empty or this job's number of
/// ranks.
void check_job_ranks(const std::vector<int>& wanted, std::string_view text, int job_ranks);

inline constexpr int kMaxScreensASide = 256;

/// "3x2", the value of `option`. Throws Error: Usage for what is no size, Limit past `max` a side.
[[nodiscard]] Size parse_size(const std::string& text, const std::string& option, int max);
/// "1,2,4,8", the value of `option`: numbers from 1 to the most ranks there may be, each once. Throws Error (Usage).
[[nodiscard]] std::vector<int> parse_counts(const std::string& list, const std::string& option);
/// 1, 2, 4 .. and `max`.
[[nodiscard]] std::vector<int> powers_of_two_up_to(int max);
/// "3x2".
[[nodiscard]] std::string grid_name(Size grid);
/// "3x2@640x360": the wall shorthand of so many screens of that size.
[[nodiscard]] std::string wall_of(Size grid, Size screen);

/// Refuses names of result files before anything is measured: two alike, the scene or another input, files that cannot
/// be written. Empty names are skipped. Throws Error.
void check_result_files(const Globals& globals, const std::string& scene, const std::vector<std::string>& inputs,
                        const std::vector<std::string>& results);
/// Writes `text()` to a file unless its name is empty. Throws Error (Io).
void write_if_named(const std::string& file, const std::function<std::string()>& text);

/// {"cpu", "cores", "mpi"}
[[nodiscard]] Json machine_json(const Machine& machine);

}  // namespace hpr
