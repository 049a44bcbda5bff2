#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <iterator>
#include <optional>

#include "app/command.h"
#include "app/doctor/doctor.h"
#include "app/launch/run_ranks.h"
#include "app/options/render_options.h"
#include "core/job_environment.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/text.h"
#include "scene/view.h"
#include "tools/bench/bench_scale.h"
#include "tools/bench/scale_model.h"
#include "tools/simulated_cluster.h"
#include "tools/sweep.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

/// Set for the jobs that are measured: "THREADS FRAMES QUIET TRACED". Rank 0 hands over its runs.
constexpr const char* kJobVariable = "OMPI_HPR_BENCH_SCALE_JOB";

struct JobOrder {
  int threads = 1;
  int frames = 1;
  int quiet = 0;   ///< what a job before has warned of already
  int traced = 0;  ///< of several jobs the last one
};

std::optional<JobOrder> job_order() {
  const std::optional<std::string> text = job_request(kJobVariable);
  JobOrder order;
  if (!text ||
      std::sscanf(text->c_str(), "%d %d %d %d", &order.threads, &order.frames, &order.quiet, &order.traced) != 4) {
    return {};
  }
  return order;
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
  /// Empty: none were given.
  [[nodiscard]] std::vector<int> given_ranks(const Globals& globals) const;
  [[nodiscard]] std::vector<int> given_threads(const Globals& globals) const;
  [[nodiscard]] std::vector<Job> jobs(const Globals& globals) const;
  [[nodiscard]] ExitCode run_model(const Globals& globals, const ScaleInput& input) const;
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
  std::string simulate_;
  int sides_ = 0;
  std::optional<Option> reps_option_;
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
  reps_option_ = options.option("--reps", frames_, "measured frames of each").range(1, 100'000).show_default();
  options.option("--warmup", warmup_, "frames of each job before those").range(0, 1000).show_default();
  options
      .option("--simulate", simulate_,
              "model the frames of a cluster by what one core takes here: hosts=64,ranks=512,latency=2us,"
              "bandwidth=12.5GB/s[,cores=,overhead=,local-latency=,local-bandwidth=,merge=]")
      .type("CLUSTER");
  options
      .option("--sides", sides_, "with --simulate: the mean of views from so many sides of the scene (0: the camera's)")
      .range(0, 64)
      .show_default();
  options.option("--csv", csv_, "write one line per frame; with --simulate per run").type("FILE");
  options.option("--html", html_, "write the result as one page with a plot").type("FILE");
  (void)declare_settings(options, settings_, SettingScope::Pictures);
  options.flag("--json", json_, "one JSON document");
}

std::vector<int> BenchScaleCommand::given_ranks(const Globals& globals) const {
  if (!ranks_.empty()) return parse_counts(ranks_, "--ranks");
  return globals.ranks > 0 ? std::vector{globals.ranks} : std::vector<int>{};
}

std::vector<int> BenchScaleCommand::given_threads(const Globals& globals) const {
  if (!threads_.empty()) return parse_counts(threads_, "--threads");
  return globals.threads > 0 ? std::vector{globals.threads} : std::vector<int>{};
}

std::vector<BenchScaleCommand::Job> BenchScaleCommand::jobs(const Globals& globals) const {
  const int cores = usable_cores();
  const std::vector<int> ranks_given = given_ranks(globals);
  const std::vector<int> threads_given = given_threads(globals);
  const bool all_given = !threads_given.empty() || !ranks_given.empty();
  const std::vector<int> ranks = ranks_given.empty() ? powers_of_two_up_to(cores) : ranks_given;
  const std::vector<int> threads = !threads_given.empty() ? threads_given
                                   : !ranks_given.empty() ? std::vector{1}
                                                          : powers_of_two_up_to(cores);
  std::vector<Job> jobs;
  for (const int thread_count : threads) {
    for (const int rank_count : ranks) {
      if (all_given || rank_count * thread_count <= cores) jobs.push_back({rank_count, thread_count});
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
  if (!input.settings.is_given("primary")) input.settings.frame.primary = Primary::Raster;
  if (!input.settings.is_given("distribute") && !input.settings.frame.in_parts()) {
    input.settings.frame.distribution = Distribution::SortFirst;
  } else if (!input.settings.frame.distribution && !input.settings.frame.in_parts()) {
    throw Error(ExitCode::Usage,
                "bench scale draws the same frame at every size: --distribute auto may choose otherwise for each",
                fmt::format("say one of {}", distribution_names()));
  }
  if (input.settings.frame.primary == Primary::Auto) {
    throw Error(ExitCode::Usage,
                "bench scale draws the same frame at every size: --primary auto may choose another way",
                "say --primary raster or --primary rays");
  }
  return input;
}

void BenchScaleCommand::check_files(const Globals& globals) const {
  check_result_files(globals, scene_, {settings_.environment}, {csv_, html_});
}

ExitCode BenchScaleCommand::run(const Globals& globals) {
  const ScaleInput input = make_input(globals);
  (void)jobs(globals);  // refuses what is no list
  if (!job_order()) check_files(globals);
  if (!simulate_.empty()) return run_model(globals, input);
  if (sides_ > 0) throw Error(ExitCode::Usage, "--sides is for --simulate", "leave it out: frames are the camera's");
  return inside_mpi_job() ? run_in_job(globals, input) : run_jobs(globals, input);
}

ExitCode BenchScaleCommand::run_model(const Globals& globals, const ScaleInput& input) const {
  if (!given_ranks(globals).empty() || !given_threads(globals).empty() || inside_mpi_job()) {
    throw Error(ExitCode::Usage, "--simulate excludes --ranks, --threads and mpirun",
                "the number of ranks is said by --simulate ranks=N, each has a core");
  }
  const FrameSettings& frame = input.settings.frame;
  if (frame.in_parts() || frame.shading == Shading::Local || frame.rays.reference) {
    throw Error(ExitCode::Usage, "there is no model of frames with --data partitioned, --shading local or --reference",
                "leave them out, or measure without --simulate");
  }
  for (const char* const name : {"distribute", "strategy", "balance"}) {
    if (!settings_.is_given(name)) continue;
    throw Error(ExitCode::Usage, fmt::format("--simulate models every distribution by demand: --{} says nothing", name),
                "leave it out");
  }
  if (reps_option_->specified()) {
    throw Error(ExitCode::Usage, "--simulate draws each view once after the --warmup: --reps says nothing",
                "leave it out");
  }
  const SimulatedCluster cluster = parse_simulation(simulate_);
  if (cluster.slowdown() > 1.0) {
    throw Error(ExitCode::Usage, "in bench scale --simulate each rank has a core",
                "say cores=N for as many ranks a host");
  }
  const ScaleModelReport report = model_scale(globals, input, cluster, sides_);
  write_if_named(csv_, [&] { return scale_model_csv(report); });
  write_if_named(html_, [&] { return scale_model_html(report); });
  std::fputs((json_ ? scale_model_json(report) : scale_model_table(report)).c_str(), stdout);
  return ExitCode::Done;
}

ExitCode BenchScaleCommand::run_in_job(const Globals& globals, const ScaleInput& input) const {
  const std::optional<JobOrder> order = job_order();
  Globals job = globals;
  job.ranks = 0;
  if (order) job.threads = order->threads;
  if (order && order->traced == 0) job.trace.clear();
  if (order && order->quiet != 0 && globals.verbosity == 0) log::configure(log::Level::Error, "");
  return run_ranks(job, [&](Communicator& comm) {
    const std::vector<int> wanted = given_ranks(globals);
    if (!order) check_job_ranks(wanted, fmt::format("{}", fmt::join(wanted, ",")), comm.size());
    std::vector<ScaleRun> runs;
    if (order) {
      runs = measure_scale(comm, job, input, order->frames);
    } else {
      std::vector<int> threads = given_threads(globals);
      if (threads.empty()) threads.push_back(0);  // each rank's share of its host's cores
      for (const int count : threads) {
        job.threads = count;
        std::ranges::move(measure_scale(comm, job, input, frames_), std::back_inserter(runs));
      }
    }
    return decide_on_root(comm, [&] {
      if (!order) return finish(globals, input, std::move(runs));
      hand_over(scale_job_columns(), std::span<const ScaleRun>(runs));
      return ExitCode::Done;
    });
  });
}

ExitCode BenchScaleCommand::run_jobs(const Globals& globals, const ScaleInput& input) const {
  const std::vector<Job> sizes = jobs(globals);
  const int rounds = std::min(kJobRounds, frames_);
  std::vector<std::vector<ScaleRun>> of_size(sizes.size());
  const std::vector<std::size_t> order = shuffled_rounds(sizes.size(), rounds, globals.seed);
  ExitCode failed = ExitCode::Done;
  const auto run_job = [&](std::size_t i) {
    const Job& size = sizes[order[i]];
    const int round = static_cast<int>(i / sizes.size());
    const int frames = frames_of_round(frames_, rounds, round);
    const JobResult job =
        run_measuring_job(globals, size.ranks, globals.args, kJobVariable,
                          fmt::format("{} {} {:d} {:d}", size.threads, frames, i > 0, i + 1 == order.size()));
    failed = job.code;
    if (failed == ExitCode::Done) append_frames(of_size[order[i]], rows_from_job(scale_job_columns(), job.rows));
    return CaseResult{.failed = failed != ExitCode::Done};
  };
  const auto describe = [&](std::size_t i) {
    return fmt::format("{} ranks of {} cores", sizes[order[i]].ranks, sizes[order[i]].threads);
  };
  (void)measure_cases({globals.progress, "job", order.size()}, describe, run_job);
  if (failed != ExitCode::Done) return failed;
  std::vector<ScaleRun> runs;
  for (std::size_t grid = 0; grid < input.grids.size(); ++grid) {
    for (std::vector<ScaleRun>& size : of_size) runs.push_back(std::move(size.at(grid)));
  }
  return finish(globals, input, std::move(runs));
}

ExitCode BenchScaleCommand::finish(const Globals& globals, const ScaleInput& input, std::vector<ScaleRun> runs) const {
  const ScaleReport report{
      "hpr " + shell_line(globals.args), this_machine(), scene_, input.size, globals.seed, std::move(runs)};
  write_if_named(csv_, [&] { return scale_csv(report); });
  write_if_named(html_, [&] { return scale_html(report); });
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
