#include "tools/sweep.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <numeric>
#include <random>

#include "app/launch/launcher.h"
#include "app/results.h"
#include "cluster/transport/collectives.h"
#include "core/file.h"
#include "core/progress.h"
#include "core/text.h"
#include "core/timing.h"
#include "engine/output.h"

namespace hpr {
namespace {

constexpr int kMaxRanks = 4096;

/// ", about 12 s left"; empty before a case was measured.
std::string time_left(std::size_t cases, std::size_t measured, double ms) {
  if (measured == 0) return "";
  return fmt::format(", about {:.0f} s left", 1e-3 * ms * static_cast<double>(cases) / static_cast<double>(measured));
}

}  // namespace

Spread spread_of(std::vector<double> values) {
  HPR_CHECK(!values.empty());
  std::ranges::sort(values);
  const std::size_t count = values.size();
  const double median = (values[(count - 1) / 2] + values[count / 2]) / 2.0;
  const auto nearest_rank = static_cast<std::size_t>(std::ceil(0.95 * static_cast<double>(count)));
  return {values.front(), median, values[nearest_rank - 1], values.back()};
}

double median(std::vector<double> values) {
  return spread_of(std::move(values)).median;
}

double wall_ms() {
  return 1e-6 * static_cast<double>(trace::now_ns());
}

std::vector<std::size_t> shuffled_rounds(std::size_t cases, int rounds, std::uint64_t seed) {
  std::vector<std::size_t> order;
  std::vector<std::size_t> of_round(cases);
  std::iota(of_round.begin(), of_round.end(), std::size_t{0});
  std::mt19937_64 random(seed);
  for (int round = 0; round < rounds; ++round) {
    std::ranges::shuffle(of_round, random);
    order.insert(order.end(), of_round.begin(), of_round.end());
  }
  return order;
}

std::vector<double> median_times(const std::vector<std::function<void()>>& contenders, Repetitions repetitions,
                                 double (*clock)()) {
  std::vector<std::vector<double>> times(contenders.size());
  measure_in_turns(contenders.size(), repetitions, [&](std::size_t contender, bool counts) {
    const double start = clock();
    contenders[contender]();
    if (counts) times[contender].push_back(clock() - start);
  });
  std::vector<double> medians;
  medians.reserve(times.size());
  for (std::vector<double>& of_one : times) medians.push_back(median(std::move(of_one)));
  return medians;
}

bool measure_cases(const SweepSettings& settings, const std::function<std::string(std::size_t)>& name,
                   const std::function<CaseResult(std::size_t)>& measure) {
  Progress progress(settings.progress, settings.what, settings.cases);
  const Stopwatch watch;
  std::size_t measured = 0;
  for (std::size_t i = 0; i < settings.cases; ++i) {
    const CaseResult result = measure(i);
    if (result.failed) return false;
    if (result.measured) ++measured;
    const std::size_t left = settings.cases - i - 1;
    progress.step(name(i) + (settings.time_left ? time_left(left, measured, watch.ms()) : ""));
    if (result.stop && left > 0) return false;
  }
  return true;
}

std::optional<std::string> job_request(const char* variable) {
  const char* const text = std::getenv(variable);  // NOLINT(concurrency-mt-unsafe): nothing sets variables
  return text == nullptr ? std::nullopt : std::optional<std::string>(text);
}

namespace {

JobResult run_measuring(int ranks, const std::vector<std::string>& arguments, JobOptions options) {
  JobResult result;
  options.captured_stdout = &result.rows;
  result.code = static_cast<ExitCode>(run_job(ranks, arguments, options));
  return result;
}

}  // namespace

JobResult run_measuring_job(const Globals& globals, int ranks, const std::vector<std::string>& arguments,
                            const char* variable, const std::string& request) {
  return run_measuring(
      ranks, arguments,
      {.environment = {{variable, request}}, .starter = globals.starter(ranks), .hang_limit = globals.hang_limit()});
}

JobResult run_measuring_process(const Globals& globals, const std::vector<std::string>& arguments, const char* variable,
                                const std::string& request) {
  return run_measuring(1, arguments,
                       {.environment = {{variable, request}},
                        .starter = std::vector<std::string>{},
                        .hang_limit = globals.hang_limit()});
}

void throw_nothing_handed_over(const JsonError& error) {
  throw Error(ExitCode::Internal, fmt::format("an MPI job did not hand over its runs: {}", error.what()));
}

ExitCode decide_on_root(Communicator& comm, const std::function<ExitCode()>& body) {
  const auto code = on_root(comm, [&] { return std::vector{static_cast<std::byte>(body())}; });
  return static_cast<ExitCode>(code.at(0));
}

void check_job_ranks(const std::vector<int>& wanted, std::string_view text, int job_ranks) {
  if (wanted.empty() || wanted == std::vector{job_ranks}) return;
  throw Error(ExitCode::Usage, fmt::format("--ranks {} inside an MPI job of {} ranks", text, job_ranks),
              "leave --ranks away, or mpirun");
}

Size parse_size(const std::string& text, const std::string& option, int max) {
  const auto extent = parse_extent(text);
  if (!extent) {
    throw Error(ExitCode::Usage, fmt::format("{}: '{}' is not two positive integers", option, printable(text)),
                fmt::format("write it like {} 3x2", option));
  }
  if (extent->first > max || extent->second > max) {
    throw Error(ExitCode::Limit, fmt::format("{}: {} is more than {} a side", option, printable(text), max),
                fmt::format("the most is {} {}x{}", option, max, max));
  }
  return {extent->first, extent->second};
}

std::vector<int> parse_counts(const std::string& list, const std::string& option) {
  std::vector<int> counts;
  for (const std::string& item : split_commas(list)) {
    int value = 0;
    const auto [end, failure] = std::from_chars(item.data(), item.data() + item.size(), value);
    if (failure != std::errc{} || end != item.data() + item.size() || value < 1 || value > kMaxRanks) {
      throw Error(ExitCode::Usage,
                  fmt::format("{}: '{}' is not a number from 1 to {}", option, printable(item), kMaxRanks),
                  fmt::format("write it like {} 1,2,4,8", option));
    }
    if (std::ranges::find(counts, value) == counts.end()) counts.push_back(value);
  }
  return counts;
}

std::vector<int> powers_of_two_up_to(int max) {
  std::vector<int> counts;
  for (int count = 1; count < max; count *= 2) counts.push_back(count);
  counts.push_back(max);
  return counts;
}

std::string grid_name(Size grid) {
  return fmt::format("{}x{}", grid.width, grid.height);
}

std::string wall_of(Size grid, Size screen) {
  return fmt::format("{}@{}", grid_name(grid), grid_name(screen));
}

void check_result_files(const Globals& globals, const std::string& scene, const std::vector<std::string>& inputs,
                        const std::vector<std::string>& results) {
  check_distinct(results, globals.trace);
  check_spared(scene, globals.scene_limits(), inputs, results);
  for (const std::string& path : results) {
    if (!path.empty()) check_writable(path, globals.force);
  }
}

void write_if_named(const std::string& file, const std::function<std::string()>& text) {
  if (!file.empty()) write_file_atomically(file, text());
}

Json machine_json(const Machine& machine) {
  return {{"cpu", machine.cpu}, {"cores", machine.cores}, {"mpi", machine.mpi}};
}

}  // namespace hpr
