#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <numeric>
#include <optional>
#include <random>

#include "app/command.h"
#include "app/doctor/doctor.h"
#include "app/launch/launcher.h"
#include "app/launch/run_ranks.h"
#include "app/options/render_options.h"
#include "app/results.h"
#include "cluster/transport/collectives.h"
#include "core/file.h"
#include "core/job_environment.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/text.h"
#include "engine/output.h"
#include "scene/view.h"
#include "tools/bench/bench_scale.h"
#include "tools/bench/bench_scale_html.h"
#include "tools/bench/bench_scale_report.h"
#include "tools/report/lists.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

/// Set for the jobs that are measured: "THREADS FRAMES QUIET TRACED". Rank 0 prints its runs for the process that
/// started it. Open MPI takes variables of this prefix to other hosts.
constexpr const char* kJobVariable = "OMPI_HPR_BENCH_SCALE_JOB";
/// Jobs of each size, with a share of the frames each, in an order by chance: what slows the machine down for a while
/// does not fall on one size alone.
constexpr int kRounds = 3;

struct JobOrder {
  int threads = 1;
  int frames = 1;
  int quiet = 0;   ///< what a job before has warned of already
  int traced = 0;  ///< of several jobs the last one
};

std::optional<JobOrder> job_order() {
  const char* const text = std::getenv(kJobVariable);  // NOLINT(concurrency-mt-unsafe): nothing sets variables
  JobOrder order;
  if (text == nullptr ||
      std::sscanf(text, "%d %d %d %d", &order.threads, &order.frames, &order.quiet, &order.traced) != 4)
    return {};
  return order;
}

/// In the order of their first mention.
std::vector<int> each_once(const std::vector<int>& counts) {
  std::vector<int> once;
  for (const int count : counts) {
    if (std::ranges::find(once, count) == once.end()) once.push_back(count);
  }
  return once;
}

/// 1, 2, 4 .. and `most`.
std::vector<int> doubled_up_to(int most) {
  std::vector<int> counts;
  for (int count = 1; count < most; count *= 2) counts.push_back(count);
  counts.push_back(most);
  return counts;
}

/// `hpr bench scale`: the same frames by jobs of several sizes, as MPI jobs of this program.
class BenchScaleCommand final : public Command {
 public:
  [[nodiscard]] bool collective() const override { return true; }
  [[nodiscard]] std::string_view name() const override { return "scale"; }
  [[nodiscard]] std::string_view summary() const override {
    return "the same frames by more and more ranks and cores, in the shape of table 6.1";
  }
  void declare(const OptionSet& options) override;
  [[nodiscard]] ExitCode run(const Globals& globals) override;

 private:
  /// One job's size.
  struct Job {
    int ranks = 1;
    int threads = 1;
  };

  [[nodiscard]] ScaleInput make_input(const Globals& globals) const;
  void check_files(const Globals& globals) const;
  /// Empty: nothing was said.
  [[nodiscard]] std::vector<int> ranks_said(const Globals& globals) const;
  [[nodiscard]] std::vector<int> threads_said(const Globals& globals) const;
  [[nodiscard]] std::vector<Job> jobs(const Globals& globals) const;
  [[nodiscard]] ExitCode run_in_job(const Globals& globals, const ScaleInput& input) const;
  [[nodiscard]] ExitCode run_jobs(const Globals& globals, const ScaleInput& input) const;
  [[nodiscard]] ExitCode finish(const Globals& globals, const ScaleInput& input, std::vector<ScaleRun> runs) const;

  std::string scene_ = "gen:gallery";
  std::string size_ = "1280x1024";
  std::string tiles_ = "1x1";
  std::string ranks_;
  std::string threads_;
  int frames_ = 5;
  int warmup_ = 1;
  std::string csv_;
  std::string html_;
  bool json_ = false;
  RenderSettings settings_;
};

void BenchScaleCommand::declare(const OptionSet& options) {
  options.option("scene", scene_, "what is drawn").show_default().type("SCENE");
  options.option("--size", size_, "pixels of a screen").show_default().type("WxH");
  options.option("--tiles", tiles_, "walls: screens side by side and one above the other")
      .show_default()
      .type("LIST of CxR");
  options.option("--ranks", ranks_, "numbers of ranks (default: 1, 2, 4 .. as many as there are cores)").type("LIST");
  options
      .option("--threads", threads_,
              "numbers of cores of each rank (default: 1; without --ranks all that the machine's cores suffice for)")
      .type("LIST");
  options.option("--reps", frames_, "measured frames of each").range(1, 100'000).show_default();
  options.option("--warmup", warmup_, "frames of each job before those").range(0, 1000).show_default();
  options.option("--csv", csv_, "write one line per frame").type("FILE");
  options.option("--html", html_, "write the result as one page with a plot").type("FILE");
  (void)declare_settings(options, settings_, SettingScope::Pictures);
  options.flag("--json", json_, "one JSON document");
}

std::vector<int> BenchScaleCommand::ranks_said(const Globals& globals) const {
  if (!ranks_.empty()) return each_once(parse_counts(ranks_, "--ranks"));
  return globals.ranks > 0 ? std::vector{globals.ranks} : std::vector<int>{};
}

std::vector<int> BenchScaleCommand::threads_said(const Globals& globals) const {
  if (!threads_.empty()) return each_once(parse_counts(threads_, "--threads"));
  return globals.threads > 0 ? std::vector{globals.threads} : std::vector<int>{};
}

std::vector<BenchScaleCommand::Job> BenchScaleCommand::jobs(const Globals& globals) const {
  const int cores = usable_cores();
  const std::vector<int> said_ranks = ranks_said(globals);
  const std::vector<int> said_threads = threads_said(globals);
  const bool all_said = !said_threads.empty() || !said_ranks.empty();
  const std::vector<int> ranks = said_ranks.empty() ? doubled_up_to(cores) : said_ranks;
  const std::vector<int> threads = !said_threads.empty() ? said_threads
                                   : !said_ranks.empty() ? std::vector{1}
                                                         : doubled_up_to(cores);
  std::vector<Job> jobs;
  for (const int thread_count : threads) {
    for (const int rank_count : ranks) {
      if (all_said || rank_count * thread_count <= cores) jobs.push_back({rank_count, thread_count});
    }
  }
  return jobs;
}

ScaleInput BenchScaleCommand::make_input(const Globals& globals) const {
  ScaleInput input{scene_, resolve(settings_, globals.seed), parse_size(size_, "--size", kRasterLimit), {}, warmup_};
  check_size(input.size, globals.picture_limits());
  for (const std::string& tiles : split_commas(tiles_)) {
    const Size grid = parse_size(tiles, "--tiles", kMaxScreensASide);
    (void)wall_from_shorthand(wall_of(grid, input.size));  // refuses too many screens
    check_size({grid.width * input.size.width, grid.height * input.size.height}, globals.picture_limits());
    if (std::ranges::find(input.grids, grid) == input.grids.end()) input.grids.push_back(grid);
  }
  if (input.settings.sampling.goal.seconds) {
    throw Error(ExitCode::Usage, "bench scale draws the same frame at every size: --spp until a time makes others",
                "write e.g. --spp 16");
  }
  if (input.settings.frame.primary == Primary::Auto) {
    throw Error(ExitCode::Usage,
                "bench scale draws the same frame at every size: --primary auto may choose another way",
                "say --primary raster or --primary rays");
  }
  return input;
}

void BenchScaleCommand::check_files(const Globals& globals) const {
  const std::vector<std::string> results{csv_, html_};
  check_distinct(results, globals.trace);
  check_spared(scene_, globals.scene_limits(), std::span(&settings_.environment, 1), results);
  for (const std::string& path : results) {
    if (!path.empty()) check_writable(path, globals.force);
  }
}

ExitCode BenchScaleCommand::run(const Globals& globals) {
  const ScaleInput input = make_input(globals);
  (void)jobs(globals);  // refuses what is no list
  if (!job_order()) check_files(globals);
  return inside_mpi_job() ? run_in_job(globals, input) : run_jobs(globals, input);
}

ExitCode BenchScaleCommand::run_in_job(const Globals& globals, const ScaleInput& input) const {
  const std::optional<JobOrder> order = job_order();
  Globals job = globals;
  job.ranks = 0;
  if (order) job.threads = order->threads;
  if (order && order->traced == 0) job.trace.clear();
  if (order && order->quiet != 0 && globals.verbosity == 0) log::configure(log::Level::Error, "");
  return run_ranks(job, [&](Communicator& comm) {
    const std::vector<int> wanted = ranks_said(globals);
    if (!order && !wanted.empty() && wanted != std::vector{comm.size()}) {
      throw Error(ExitCode::Usage,
                  fmt::format("--ranks {} inside an MPI job of {} ranks", fmt::join(wanted, ","), comm.size()),
                  "leave --ranks away, or mpirun");
    }
    std::vector<ScaleRun> runs;
    if (order) {
      runs = measure_scale(comm, job, input, order->frames);
    } else {
      std::vector<int> threads = threads_said(globals);
      if (threads.empty()) threads.push_back(0);  // each rank's share of its host's cores
      for (const int count : threads) {
        job.threads = count;
        std::ranges::move(measure_scale(comm, job, input, frames_), std::back_inserter(runs));
      }
    }
    const auto verdict = on_root(comm, [&] {
      if (!order) return std::vector{static_cast<std::byte>(finish(globals, input, std::move(runs)))};
      std::fputs(scale_runs_to_json(runs).c_str(), stdout);
      return std::vector{static_cast<std::byte>(ExitCode::Done)};
    });
    return static_cast<ExitCode>(verdict.at(0));
  });
}

ExitCode BenchScaleCommand::run_jobs(const Globals& globals, const ScaleInput& input) const {
  const std::vector<Job> sizes = jobs(globals);
  const int rounds = std::min(kRounds, frames_);
  std::vector<std::vector<ScaleRun>> of_size(sizes.size());
  std::vector<std::size_t> order(sizes.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::mt19937_64 chance(globals.seed);
  Progress progress(globals.progress, "job", sizes.size() * static_cast<std::size_t>(rounds));
  bool quiet = false;
  for (int round = 0; round < rounds; ++round) {
    std::ranges::shuffle(order, chance);
    const int frames = frames_ / rounds + (round < frames_ % rounds ? 1 : 0);
    for (const std::size_t index : order) {
      const Job& job = sizes[index];
      std::string output;
      const bool last = round + 1 == rounds && index == order.back();
      const std::string words = fmt::format("{} {} {:d} {:d}", job.threads, frames, quiet, last);
      const int code = run_mpiexec(
          job.ranks, globals.args,
          {.captured_stdout = &output, .environment = {{kJobVariable, words}}, .hang_limit = globals.hang_limit()});
      // Its ranks have said on stderr what went wrong.
      if (code != static_cast<int>(ExitCode::Done)) return static_cast<ExitCode>(code);
      append_frames(of_size[index], scale_runs_from_json(output));
      quiet = true;
      progress.step(fmt::format("{} ranks of {} cores", job.ranks, job.threads));
    }
  }
  progress.end();
  std::vector<ScaleRun> runs;
  for (std::size_t grid = 0; grid < input.grids.size(); ++grid) {
    for (std::vector<ScaleRun>& size : of_size) runs.push_back(std::move(size.at(grid)));
  }
  return finish(globals, input, std::move(runs));
}

ExitCode BenchScaleCommand::finish(const Globals& globals, const ScaleInput& input, std::vector<ScaleRun> runs) const {
  const ScaleReport report{
      "hpr " + shell_line(globals.args), this_machine(), scene_, input.size, globals.seed, std::move(runs)};
  if (!csv_.empty()) write_file_atomically(csv_, scale_csv(report));
  if (!html_.empty()) write_file_atomically(html_, scale_html(report));
  std::fputs((json_ ? scale_json(report) : scale_table(report)).c_str(), stdout);
  for (const std::string& sentence : slow_ranks(report)) log::warning("{}", sentence);
  if (pictures_agree(report)) return ExitCode::Done;
  if (settings_.frame.shading == Shading::Local) {
    log::warning("not all runs of a wall made the same picture: with --shading local coplanar surfaces may differ");
    return ExitCode::Done;
  }
  log::error("not all runs of a wall made the same picture: compare their frame hashes");
  return ExitCode::CheckFailed;
}

}  // namespace

std::unique_ptr<Command> make_bench_scale_command() {
  return std::make_unique<BenchScaleCommand>();
}

}  // namespace hpr
