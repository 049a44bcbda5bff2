#include "app/compare_command.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <limits>

#include "app/compare_html.h"
#include "app/compare_options.h"
#include "app/compare_report.h"
#include "app/compare_threads.h"
#include "app/launcher.h"
#include "app/output.h"
#include "app/simulate_option.h"
#include "app/trace_file.h"
#include "cluster/scene_distribution.h"
#include "compositing/blender.h"
#include "compositing/compositor.h"
#include "compositing/plugin.h"
#include "compositing/synthetic.h"
#include "core/file.h"
#include "core/names.h"
#include "core/units.h"
#include "image/image_io.h"

namespace hpr {
namespace {

/// Set for the MPI jobs `hpr compare` starts: rank 0 prints its runs as JSON for the process that started the job.
constexpr const char* kHandOverVariable = "HPR_COMPARE_HAND_OVER";
constexpr int kLargestSide = 16384;
constexpr int kMostScreensASide = 256;

bool hands_over() {
  return std::getenv(kHandOverVariable) != nullptr;  // NOLINT(concurrency-mt-unsafe): nothing sets variables
}

class CompareCommand final : public Command {
 public:
  explicit CompareCommand(SceneInput scene_input) : scene_input_(std::move(scene_input)) {}

  [[nodiscard]] bool collective() const override { return true; }
  [[nodiscard]] std::string_view name() const override { return "compare"; }
  [[nodiscard]] std::string_view summary() const override {
    return "measure compositing strategies against each other on the same layers, and check that they agree";
  }

  void declare(CLI::App& app) override {
    if (scene_input_) app.add_option("scene", scene_, "a scene to draw the layers from")->type_name("SCENE");
    app.add_option("--synthetic", synthetic_, "made-up layers: dense, half, sparse, scatter or checker")
        ->type_name("KIND");
    app.add_option("--size", size_, "pixels of one screen")->type_name("WxH")->capture_default_str();
    app.add_option("--tiles", tiles_, "screens of the wall")->type_name("CxR")->capture_default_str();
    app.add_option("--ranks", ranks_, "numbers of ranks to run on (2,4; inside an MPI job: that job's)")
        ->type_name("LIST");
    app.add_option(
           "--operator", operator_,
           "nearest: the nearest surface; over8, overf: translucent layers, ranks from front to back, in 8 bits or "
           "floats a channel")
        ->type_name("NAME")
        ->capture_default_str();
    app.add_option("--strategies", strategies_, "all, or names of strategies")
        ->type_name("LIST")
        ->capture_default_str();
    app.add_option("--plugin", plugin_, "a shared object with one more strategy (docs/compositing.md)")
        ->type_name("FILE.so");
    frames_option_ = app.add_option("--frames", frames_, "measured frames");
    frames_option_->type_name("N")->check(CLI::Range(1, 1'000'000))->capture_default_str();
    app.add_option("--warmup", warmup_, "frames before the measured ones")
        ->type_name("N")
        ->check(CLI::Range(0, 1'000'000))
        ->capture_default_str();
    app.add_option("--simulate", simulate_,
                   "run on threads and reckon what a cluster would take: hosts=64,ranks=512,latency=2us,"
                   "bandwidth=12.5GB/s[,cores=,overhead=,local-latency=,local-bandwidth=,merge=]")
        ->type_name("CLUSTER");
    app.add_option("--transport", transport_, "mpi, or threads of one process")
        ->type_name("NAME")
        ->capture_default_str();
    app.add_option("--csv", csv_, "write one line per run to this file")->type_name("FILE");
    app.add_option("--html", html_, "write the result as one page with plots and drawings")->type_name("FILE");
    app.add_flag("--json", json_, "print the result as JSON (schema hpr.compare/1) instead of a table");
    app.add_option("-o,--output", picture_, "write the composited frame of the last number of ranks")
        ->type_name("FILE.png");
    app.add_option("--raw", raw_, "write that frame's keys: per pixel uint64, row 0 at the top")->type_name("FILE");
  }

  ExitCode run(const Globals& globals) override {
    if (!plugin_.empty()) load_compositor_plugin(plugin_);
    if (!simulate_.empty() && frames_option_->count() == 0) frames_ = warmup_ = 1;  // simulated frames are all alike
    const CompareInput input = make_input(globals);
    check_options(globals);
    return inside_mpi_job() ? run_in_job(globals, input) : run_here(globals, input);
  }

 private:
  [[nodiscard]] CompareInput make_input(const Globals& globals) const {
    const Size screen = parse_size(size_, "--size", kLargestSide);
    const Size grid = parse_size(tiles_, "--tiles", kMostScreensASide);
    if (scene_.empty() == synthetic_.empty()) {
      throw Error(ExitCode::Usage,
                  scene_.empty() ? "nothing to composite" : "a scene and --synthetic exclude each other",
                  scene_input_ ? "name a scene, or --synthetic dense|half|sparse|scatter|checker"
                               : "add --synthetic dense|half|sparse|scatter|checker");
    }
    if (!scene_.empty()) return scene_input_(scene_, screen, grid, globals);
    if (globals.seed > std::numeric_limits<std::uint32_t>::max()) {
      throw Error(ExitCode::Usage, fmt::format("--seed: synthetic layers take 32 bits, {} has more", globals.seed));
    }
    const SyntheticKind kind = parse_synthetic_kind(synthetic_);
    const auto seed = static_cast<std::uint32_t>(globals.seed);
    return {synthetic_, screen, grid, true,
            [=](Communicator& comm) { return synthetic_wall(kind, comm.rank(), screen, grid, seed); }};
  }

  /// Everything that can be refused before any rank starts.
  void check_options(const Globals& globals) const {
    const std::vector<std::string> transports{"mpi", "threads"};
    if (std::ranges::find(transports, transport_) == transports.end()) {
      throw Error(ExitCode::Usage, fmt::format("no transport is named '{}'", printable(transport_)),
                  unknown_name_hint(printable(transport_), transports));
    }
    if (!simulate_.empty()) check_simulation();
    check_operator();
    for (const int ranks : rank_counts()) (void)strategies_for(ranks);
    if (inside_mpi_job() && transport_ != "mpi") {
      throw Error(ExitCode::Usage, "--transport threads runs in one process, not in an MPI job",
                  "leave mpirun away, or --transport");
    }
    if (hands_over()) return;  // the process that started this job has looked already
    if (!picture_.empty() && !picture_.ends_with(".png")) {
      throw Error(ExitCode::Usage, fmt::format("-o: '{}' does not end in .png", printable(picture_)));
    }
    const std::vector<std::string> results{csv_, html_, picture_, raw_};
    check_distinct(results, globals.trace);
    check_spared(scene_, globals.scene_limits(), {}, results);
    for (const std::string& path : results) {
      if (!path.empty()) check_writable(path, globals.force);
    }
  }

  [[nodiscard]] CompareOperator operation() const {
    if (operator_ == "nearest") return CompareOperator::Nearest;
    return operator_ == "over8" ? CompareOperator::Over8 : CompareOperator::OverFloat;
  }

  void check_operator() const {
    const std::vector<std::string> operators{"nearest", "over8", "overf"};
    if (std::ranges::find(operators, operator_) == operators.end()) {
      throw Error(ExitCode::Usage, fmt::format("no operator is named '{}'", printable(operator_)),
                  unknown_name_hint(printable(operator_), operators));
    }
    if (operation() != CompareOperator::Nearest && !raw_.empty()) {
      throw Error(ExitCode::Usage, "--raw writes keys, and translucent layers have none", "take -o FILE.png");
    }
  }

  void check_simulation() const {
    if (!ranks_.empty() || transport_ != "mpi" || inside_mpi_job()) {
      throw Error(ExitCode::Usage, "--simulate excludes --ranks, --transport and mpirun",
                  "the number of ranks is said by --simulate ranks=N; it runs on threads of one process");
    }
  }

  /// Empty inside an MPI job unless --ranks is given.
  [[nodiscard]] std::vector<int> rank_counts() const {
    if (!simulate_.empty()) return {parse_simulation(simulate_).ranks};
    if (!ranks_.empty()) return parse_ranks(ranks_);
    return inside_mpi_job() ? std::vector<int>{} : std::vector<int>{2, 4};
  }

  [[nodiscard]] std::vector<std::string> all_strategies_for(int ranks) const {
    std::vector<std::string> names;
    const auto add_fitting = [&](const auto& strategies) {
      for (const auto& strategy : strategies) {
        if (strategy->fits(ranks)) names.emplace_back(strategy->name());
      }
    };
    if (operation() == CompareOperator::Nearest) {
      add_fitting(all_compositors());
      if (!scene_.empty()) names.emplace_back(kSortFirst);
    } else {
      add_fitting(all_blenders<RgbaPremultiplied>());
    }
    return names;
  }

  [[nodiscard]] std::vector<std::string> strategies_for(int ranks) const {
    if (strategies_ == "all") return all_strategies_for(ranks);
    std::vector<std::string> names;
    for (const std::string& name : split_strategies(strategies_)) {
      if (name == kSortFirst && operation() == CompareOperator::Nearest) {
        if (scene_.empty()) {
          throw Error(ExitCode::Usage, "sort-first draws a scene, and there is none",
                      "name a scene instead of --synthetic");
        }
      } else if (!fits(name, ranks)) {
        throw Error(ExitCode::Usage, fmt::format("strategy {} cannot run on {} ranks", name, ranks),
                    "leave it out, or choose another number with --ranks");
      }
      names.push_back(name);
    }
    return names;
  }

  /// Throws Error (Usage) when no strategy of that name can do what is asked for.
  [[nodiscard]] bool fits(const std::string& name, int ranks) const {
    if (operation() == CompareOperator::Nearest) return make_compositor(name)->fits(ranks);
    return make_blender<RgbaPremultiplied>(name)->fits(ranks);
  }

  [[nodiscard]] CompareSettings settings_for(int ranks) const {
    return {strategies_for(ranks), frames_, warmup_, operation()};
  }

  /// Inside an MPI job: its ranks are the one number of ranks compared.
  [[nodiscard]] ExitCode run_in_job(const Globals& globals, const CompareInput& input) const {
    Globals job = globals;
    job.ranks = 0;
    return run_ranks(job, [&](Communicator& comm) {
      const std::vector<int> wanted = rank_counts();
      if (!wanted.empty() && wanted != std::vector<int>{comm.size()}) {
        throw Error(ExitCode::Usage, fmt::format("--ranks {} inside an MPI job of {} ranks", ranks_, comm.size()),
                    "leave --ranks away, or mpirun");
      }
      CompareResult result = compare_strategies(comm, input, settings_for(comm.size()));
      const auto verdict = on_root(comm, [&] {
        if (!hands_over()) {
          return std::vector{static_cast<std::byte>(finish(globals, input, std::move(result)))};
        }
        write_frame(result, input);
        std::fputs(runs_to_json(result.runs).c_str(), stdout);
        return std::vector{static_cast<std::byte>(verdict_on(result.runs))};
      });
      return static_cast<ExitCode>(verdict.at(0));
    });
  }

  /// One process: ranks are threads, or MPI jobs of this program that hand over their runs.
  [[nodiscard]] ExitCode run_here(const Globals& globals, const CompareInput& input) const {
    if (on_threads()) return traced_alone(globals, [&] { return measure_here(globals, input); });
    return measure_here(globals, input);
  }

  [[nodiscard]] bool on_threads() const { return transport_ == "threads" || !simulate_.empty(); }

  [[nodiscard]] ExitCode measure_here(const Globals& globals, const CompareInput& input) const {
    CompareResult result;
    const std::vector<int> counts = rank_counts();
    for (const int ranks : counts) check_memory(globals, input, ranks);  // all before any is measured
    for (std::size_t i = 0; i < counts.size(); ++i) {
      const int ranks = counts[i];
      std::vector<CompareRun> runs;
      if (on_threads()) {
        CompareResult here = compare_on_threads(ranks, simulate_, globals.hang_limit(), input, settings_for(ranks));
        runs = std::move(here.runs);
        result.frame = std::move(here.frame);
        result.picture = std::move(here.picture);
      } else {
        std::string output;
        const int code = run_mpiexec(ranks, job_arguments(globals, ranks, i + 1 == counts.size()),
                                     {.captured_stdout = &output, .environment = {{kHandOverVariable, "1"}}});
        // Its ranks have said on stderr what went wrong.
        if (code != static_cast<int>(ExitCode::Done) && code != static_cast<int>(ExitCode::CheckFailed)) {
          return static_cast<ExitCode>(code);
        }
        runs = runs_from_json(output);
      }
      result.runs.insert(result.runs.end(), runs.begin(), runs.end());
    }
    return finish(globals, input, std::move(result));
  }

  /// Refuses what this host cannot hold, before ranks start to share it.
  void check_memory(const Globals& globals, const CompareInput& input, int ranks) const {
    const auto pages = static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES));
    const std::uint64_t physical = pages * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
    const std::uint64_t limit = parse_bytes(globals.limit_mem).value_or(physical);
    // Every rank keeps its layer and two to work on; rank 0 also the expected frame, one that arrives and the image.
    const std::uint64_t pixel = operation() == CompareOperator::OverFloat ? sizeof(RgbaPremultiplied) : sizeof(Key);
    const std::uint64_t layer = grid_layout(input.screen, input.grid).tiles() * kTilePixels * pixel;
    const std::uint64_t needed = layer * (3 * static_cast<std::uint64_t>(ranks) + 3);
    if (needed <= limit) return;
    throw Error(
        ExitCode::Limit,
        fmt::format("{} ranks need about {} MiB of memory, {} MiB may be used", ranks, needed >> 20U, limit >> 20U),
        "take fewer ranks, fewer screens or smaller ones");
  }

  /// What a job needs to run `ranks` of the rank counts; `last`: it also writes the frame.
  [[nodiscard]] std::vector<std::string> job_arguments(const Globals& globals, int ranks, bool last) const {
    std::vector<std::string> arguments = input_arguments(globals);
    const auto add = [&](const std::string& option, const std::string& value) {
      arguments.push_back(option);
      arguments.push_back(value);
    };
    add("--ranks", std::to_string(ranks));
    if (last && !picture_.empty()) add("-o", picture_);
    if (last && !raw_.empty()) add("--raw", raw_);
    if (last && !globals.trace.empty()) add("--trace", globals.trace);
    add("--backend", globals.backend);
    if (globals.device >= 0) add("--device", std::to_string(globals.device));
    if (globals.threads > 0) add("--threads", std::to_string(globals.threads));
    if (!globals.limit_mem.empty()) add("--limit-mem", globals.limit_mem);
    if (!globals.limit_image.empty()) add("--limit-image", globals.limit_image);
    if (!globals.hang_timeout.empty()) add("--hang-timeout", globals.hang_timeout);
    if (globals.force) arguments.emplace_back("--force");
    for (int i = 0; i < globals.verbosity; ++i) arguments.emplace_back("-v");
    if (globals.verbosity < 0) arguments.emplace_back("-q");
    return arguments;
  }

  /// What decides the result, without the number of ranks.
  [[nodiscard]] std::vector<std::string> input_arguments(const Globals& globals) const {
    std::vector<std::string> arguments{"compare"};
    if (!scene_.empty()) arguments.push_back(scene_);
    if (!synthetic_.empty()) arguments.insert(arguments.end(), {"--synthetic", synthetic_});
    if (!plugin_.empty()) arguments.insert(arguments.end(), {"--plugin", plugin_});
    arguments.insert(arguments.end(), {"--size", size_, "--tiles", tiles_, "--strategies", strategies_});
    if (operation() != CompareOperator::Nearest) arguments.insert(arguments.end(), {"--operator", operator_});
    arguments.insert(arguments.end(), {"--frames", std::to_string(frames_), "--warmup", std::to_string(warmup_)});
    if (simulate_.empty()) {
      arguments.insert(arguments.end(), {"--transport", transport_});
    } else {
      arguments.insert(arguments.end(), {"--simulate", simulate_});
    }
    arguments.insert(arguments.end(), {"--seed", std::to_string(globals.seed)});
    return arguments;
  }

  [[nodiscard]] static ExitCode verdict_on(const std::vector<CompareRun>& runs) {
    const bool differ = std::ranges::any_of(runs, [](const CompareRun& run) { return run.differing_pixels > 0; });
    return differ ? ExitCode::CheckFailed : ExitCode::Done;
  }

  /// Writes the files that were asked for; the result is without frames where a job has written them.
  void write_frame(const CompareResult& result, const CompareInput& input) const {
    if (!result.picture.pixels().empty() && !picture_.empty()) write_png(picture_, result.picture);
    if (result.frame.pixels().empty()) return;
    if (!picture_.empty()) write_png(picture_, frame_colors(result.frame, input.colors));
    if (!raw_.empty()) write_file_atomically(raw_, std::as_bytes(result.frame.pixels()));
  }

  [[nodiscard]] ExitCode finish(const Globals& globals, const CompareInput& input, CompareResult result) const {
    CompareReport report;
    report.machine = this_machine();
    report.screen = input.screen;
    report.grid = input.grid;
    report.input = input.name;
    report.operation = operator_;
    report.seed = globals.seed;
    std::vector<int> counts;
    for (const CompareRun& run : result.runs) {
      if (counts.empty() || counts.back() != run.ranks) counts.push_back(run.ranks);
    }
    report.command = fmt::format("hpr {}", fmt::join(input_arguments(globals), " "));
    if (simulate_.empty()) report.command += fmt::format(" --ranks {}", fmt::join(counts, ","));
    report.runs = std::move(result.runs);
    write_frame(result, input);
    if (!csv_.empty()) write_file_atomically(csv_, compare_csv(report));
    if (!html_.empty()) write_file_atomically(html_, compare_html(report, draw_strategies(report.runs)));
    std::fputs((json_ ? compare_json(report) : compare_table(report)).c_str(), stdout);
    return verdict_on(report.runs);
  }

  SceneInput scene_input_;
  std::string scene_;
  std::string synthetic_;
  std::string size_ = "1920x1080";
  std::string tiles_ = "1x1";
  std::string ranks_;
  std::string operator_ = "nearest";
  std::string strategies_ = "all";
  std::string plugin_;
  int frames_ = 10;
  int warmup_ = 2;
  CLI::Option* frames_option_ = nullptr;
  std::string transport_ = "mpi";
  std::string simulate_;
  std::string csv_;
  std::string html_;
  bool json_ = false;
  std::string picture_;
  std::string raw_;
};

}  // namespace

std::unique_ptr<Command> make_compare_command(SceneInput scene_input) {
  return std::make_unique<CompareCommand>(std::move(scene_input));
}

}  // namespace hpr
