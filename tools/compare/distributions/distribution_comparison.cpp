#include "tools/compare/distributions/distribution_comparison.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <optional>
#include <span>
#include <utility>

#include "app/launch/run_ranks.h"
#include "app/results.h"
#include "cluster/distribution/assignment.h"
#include "cluster/transport/collectives.h"
#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"
#include "core/file.h"
#include "core/job_environment.h"
#include "core/log.h"
#include "core/peak_memory.h"
#include "core/text.h"
#include "image/image_io.h"
#include "tools/compare/distributions/distribution_report.h"
#include "tools/sweep.h"

namespace hpr {
namespace {

/// One comparison, in the process that a user started or in a job of it.
class DistributionComparison {
 public:
  DistributionComparison(const Globals& globals, const CompareOptions& options)
      : globals_(globals), options_(options), input_{options.scene, options.settings, {}, {}, globals.seed} {
    const auto [screen, grid] = options.wall_size(globals);
    input_.screen = screen;
    input_.grid = grid;
    names_ = distributions_in(options.distributions, input_);
  }

  /// A job that another process started: measures one distribution, and hands it over.
  [[nodiscard]] ExitCode run_job(const DistributionJob& job) const;
  /// Inside a job that a user started.
  [[nodiscard]] ExitCode run_in_job() const;
  /// In a process that starts jobs.
  [[nodiscard]] ExitCode run_jobs() const;

 private:
  /// Runs `body` on the ranks of this job, which are threads of this process where `threads` is not 0.
  [[nodiscard]] ExitCode run_on_ranks(const Globals& globals, int threads,
                                      const std::function<ExitCode(Communicator&)>& body) const;
  [[nodiscard]] JobResult start(const DistributionJob& job) const;
  [[nodiscard]] bool writes_files() const { return !options_.picture.empty() || !options_.raw.empty(); }
  void write_files(const WholeFrame& frame) const;
  [[nodiscard]] ExitCode finish(std::vector<DistributionRun> runs) const;

  const Globals& globals_;
  const CompareOptions& options_;
  DistributionInput input_;
  std::vector<std::string> names_;
};

ExitCode DistributionComparison::run_on_ranks(const Globals& globals, int threads,
                                              const std::function<ExitCode(Communicator&)>& body) const {
  Globals job = globals;
  job.ranks = 0;
  if (threads == 0) return run_ranks(job, body);
  job.launcher.clear();  // it starts ranks of MPI
  return run_ranks(job, [&](Communicator& /*alone*/) {
    ExitCode code = ExitCode::Done;
    run_local_ranks({.size = threads, .hang_timeout = globals.hang_limit()}, [&](Communicator& untraced) {
      TracingCommunicator comm(untraced);
      const ExitCode mine = body(comm);
      if (comm.rank() == 0) code = mine;
    });
    return code;
  });
}

ExitCode DistributionComparison::run_job(const DistributionJob& job) const {
  Globals globals = globals_;
  if (!job.is_last) globals.trace.clear();
  if (job.is_quiet && globals.verbosity == 0) log::configure(log::Level::Error, "");
  const bool on_threads = !inside_mpi_job();
  return run_on_ranks(globals, on_threads ? job.ranks : 0, [&](Communicator& comm) {
    std::optional<WholeFrame> reference;
    WholeFrame last;
    const auto check = [&](const WholeFrame& frame) -> std::uint64_t {
      if (job.makes_reference) {
        write_frame(job.reference, frame);
        return 0;
      }
      if (!reference) reference = read_frame(job.reference);
      if (job.is_last && writes_files()) last = frame;
      return count_differing(frame, *reference);
    };
    DistributionRun run = measure_distribution(comm, globals, input_, job.distribution, job.frames, check);
    if (on_threads) run.memory_of = kMemoryOfProcess;
    return decide_on_root(comm, [&] {
      if (job.is_last) write_files(last);
      hand_over(distribution_job_columns(), std::span<const DistributionRun>(&run, 1));
      return ExitCode::Done;
    });
  });
}

ExitCode DistributionComparison::run_in_job() const {
  return run_on_ranks(globals_, 0, [&](Communicator& comm) {
    check_job_ranks(options_.rank_counts(), options_.ranks, comm.size());
    std::vector<DistributionRun> runs(names_.size());
    std::optional<WholeFrame> reference;
    WholeFrame last;
    const auto check = [&](const WholeFrame& frame) -> std::uint64_t {
      if (!reference) reference = frame;
      if (writes_files()) last = frame;
      return count_differing(frame, *reference);
    };
    const int rounds = std::min(kJobRounds, options_.frames);
    const std::vector<std::size_t> order = shuffled_rounds(names_.size(), rounds, globals_.seed);
    for (std::size_t i = 0; i < order.size(); ++i) {
      const int frames = frames_of_round(options_.frames, rounds, static_cast<int>(i / names_.size()));
      const bool reference_was_kept = i > 0;
      const std::vector<int> begun = all_gather_value(comm, reset_peak_memory() ? 1 : 0);
      DistributionRun run =
          measure_distribution(comm, globals_, input_, names_[order[i]], {options_.warmup, frames}, check);
      const bool all_begun = std::ranges::find(begun, 0) == begun.end();
      // Rank 0 keeps the first frame to compare others with.
      run.memory_of = all_begun && !reference_was_kept ? kMemoryOfRank : kMemoryOfJob;
      DistributionRun& known = runs[order[i]];
      if (known.ms.empty()) {
        known = std::move(run);
      } else {
        known.append(run);
      }
    }
    return decide_on_root(comm, [&] {
      write_files(last);
      return finish(std::move(runs));
    });
  });
}

JobResult DistributionComparison::start(const DistributionJob& job) const {
  if (options_.on_threads()) {
    return run_measuring_process(globals_, globals_.args, DistributionJob::kVariable, job.text());
  }
  return run_measuring_job(globals_, job.ranks, globals_.args, DistributionJob::kVariable, job.text());
}

ExitCode DistributionComparison::run_jobs() const {
  const std::vector<int> counts = options_.rank_counts();
  // Ranks that a launcher takes to other hosts find the file in the folder that all hosts see.
  const TemporaryFile reference =
      globals_.launcher.empty() || options_.on_threads() ? TemporaryFile() : TemporaryFile(".");
  const JobResult made = start({.distribution = names_.front(),
                                .ranks = 1,
                                .frames = {0, 1},
                                .makes_reference = true,
                                .reference = reference.path().string()});
  if (!made.measured()) return made.code;

  const std::size_t cases = names_.size() * counts.size();
  std::vector<DistributionRun> runs(cases);
  const int rounds = std::min(kJobRounds, options_.frames);
  const std::vector<std::size_t> order = shuffled_rounds(cases, rounds, globals_.seed);
  const auto job_of = [&](std::size_t i) {
    return DistributionJob{
        .distribution = names_[order[i] % names_.size()],
        .ranks = counts[order[i] / names_.size()],
        .frames = {options_.warmup, frames_of_round(options_.frames, rounds, static_cast<int>(i / cases))},
        .is_quiet = i > 0,
        .is_last = i + 1 == order.size(),
        .reference = reference.path().string()};
  };
  ExitCode code = ExitCode::Done;
  const auto run_one = [&](std::size_t i) {
    const JobResult job = start(job_of(i));
    if (!job.measured()) {
      code = job.code;
      return CaseResult{.failed = true};
    }
    DistributionRun run = rows_from_job(distribution_job_columns(), job.rows).at(0);
    DistributionRun& known = runs[order[i]];
    if (known.ms.empty()) {
      known = std::move(run);
    } else {
      known.append(run);
    }
    return CaseResult{};
  };
  const auto describe = [&](std::size_t i) {
    return fmt::format("{} on {} rank{}", job_of(i).distribution, job_of(i).ranks, job_of(i).ranks == 1 ? "" : "s");
  };
  if (!measure_cases({globals_.progress, "job", order.size(), true}, describe, run_one)) return code;
  return finish(std::move(runs));
}

void DistributionComparison::write_files(const WholeFrame& frame) const {
  if (!options_.picture.empty()) write_png(options_.picture, frame.picture);
  if (!options_.raw.empty()) write_file_atomically(options_.raw, std::as_bytes(frame.keys.pixels()));
}

ExitCode DistributionComparison::finish(std::vector<DistributionRun> runs) const {
  DistributionReport report;
  report.command = "hpr " + shell_line(globals_.args);
  report.machine = this_machine();
  report.screen = input_.screen;
  report.grid = input_.grid;
  report.input = input_.scene;
  report.seed = globals_.seed;
  report.runs = std::move(runs);
  write_if_named(options_.csv, [&] { return distribution_csv(report); });
  write_if_named(options_.html, [&] { return distribution_html(report); });
  std::fputs((options_.json ? distribution_json(report) : distribution_table(report)).c_str(), stdout);
  if (report.frames_agree()) return ExitCode::Done;
  if (options_.local_shading()) {
    log::warning("not all frames are the reference's: with --shading local coplanar surfaces may differ");
    return ExitCode::Done;
  }
  log::error("not all frames are the reference's: see the differing pixels");
  return ExitCode::CheckFailed;
}

}  // namespace

std::vector<std::string> distributions_in(const std::string& list, const DistributionInput& input) {
  const std::vector<std::string> further{kAutoDistribution, "all"};
  std::vector<std::string> names;
  const auto add = [&](const std::string& name) {
    if (std::ranges::find(names, name) == names.end()) names.push_back(name);
  };
  if (list != "all") {
    for (const std::string& name : split_commas(list)) {
      if (name == "all") {
        throw Error(ExitCode::Usage, fmt::format("--distribute {}: 'all' stands alone", printable(list)),
                    "write --distribute all, or leave it out of the list");
      }
      if (name != kAutoDistribution) (void)parse_distribution(name, further);
      (void)input.settings_for(name);
      add(name);
    }
    return names;
  }
  std::optional<Error> excluded;
  const auto add_unless_excluded = [&](const std::string& name) {
    try {
      (void)input.settings_for(name);
      add(name);
    } catch (const Error& error) {
      if (error.code() != ExitCode::Usage) throw;
      excluded = error;
      log::debug("{} is left out: {}", name, error.what());
    }
  };
  for (const Distribution distribution : kDistributions) add_unless_excluded(std::string(name_of(distribution)));
  add_unless_excluded(kAutoDistribution);
  if (names.empty()) throw Error(*excluded);
  return names;
}

ExitCode compare_distributions(const Globals& globals, CompareOptions& options) {
  options.resolve();
  if (options.scene.empty()) {
    throw Error(ExitCode::Usage, "--distribute draws whole frames of a scene, and there is none", "name a scene");
  }
  const std::optional<DistributionJob> job = DistributionJob::of_this_process();
  const DistributionComparison comparison(globals, options);
  if (job) return comparison.run_job(*job);
  options.check_files(globals);
  return inside_mpi_job() ? comparison.run_in_job() : comparison.run_jobs();
}

}  // namespace hpr
