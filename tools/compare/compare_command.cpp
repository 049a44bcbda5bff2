#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <limits>
#include <span>
#include <utility>

#include "app/command.h"
#include "app/launch/run_ranks.h"
#include "app/results.h"
#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"
#include "cluster/transport/simulated_communicator.h"
#include "compositing/model/synthetic.h"
#include "core/file.h"
#include "core/job_environment.h"
#include "core/text.h"
#include "engine/frame.h"
#include "engine/output.h"
#include "engine/render_settings.h"
#include "engine/session.h"
#include "image/image_io.h"
#include "scene/view.h"
#include "tools/compare/compare.h"
#include "tools/compare/compare_options.h"
#include "tools/compare/compare_report.h"
#include "tools/compare/distributions/distribution_comparison.h"
#include "tools/simulated_cluster.h"
#include "tools/sweep.h"
#include "walls/config/wall_file.h"
#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

/// Set for the MPI jobs `hpr compare` starts, whose rank 0 hands over its runs.
constexpr const char* kJobVariable = "OMPI_HPR_COMPARE_HAND_OVER";

bool hands_over() {
  return job_request(kJobVariable).has_value();
}

/// Collective: the part of a frame that this rank draws.
DrawnTiles draw_part(Communicator& comm, const std::string& scene, const Wall& wall, const Globals& globals,
                     const FrameSettings& settings) {
  Session session(comm, globals.session(), [&] { return load_scene(scene, globals.scene_limits()); });
  const std::vector<View> views =
      wall_views(wall, choose_camera(CameraChoice{}, session.scene()), session.scene().bounds);
  FramePlan plan = plan_frame(session, settings, views);
  plan.lit = false;
  TileLayer<Key> layer(plan.layout);
  (void)draw_layer(session, plan, views, layer);
  return {std::move(layer), plan.tiles};
}

/// The layers of `hpr compare SCENE`: each rank's objects of the scene (sort-last), drawn over a wall of `grid` screens
/// of `screen` pixels. With `local_shading` each rank lights its own, once per pixel and as render does by default, and
/// the keys carry colors.
CompareInput scene_layers(const std::string& scene, Size screen, Size grid, bool local_shading,
                          const Globals& globals) {
  const Wall wall = load_wall(wall_of(grid, screen));
  CompareInput input;
  input.name = scene;
  input.screen = screen;
  input.grid = grid;
  input.colors = local_shading;
  FrameSettings settings = resolve(RenderSettings{}, globals.seed).frame;
  settings.shading = local_shading ? Shading::Local : Shading::Deferred;
  settings.distribution = Distribution::SortLast;
  input.layer = [=](Communicator& comm) { return draw_part(comm, scene, wall, globals, settings).layer; };
  settings.distribution = Distribution::SortFirst;
  input.sort_first = [=](Communicator& comm) { return draw_part(comm, scene, wall, globals, settings); };
  return input;
}

/// compare_strategies with `ranks` threads of this process as ranks, on a simulated cluster (parse_simulation) unless
/// `simulate` is empty.
CompareResult compare_on_threads(int ranks, const std::string& simulate, std::chrono::nanoseconds hang_timeout,
                                 const CompareInput& input, const CompareSettings& settings) {
  CompareResult result;
  const auto compare = [&](Communicator& untraced) {
    TracingCommunicator comm(untraced);
    CompareResult here = compare_strategies(comm, input, settings);
    if (comm.rank() == 0) result = std::move(here);
  };
  LocalRanks local{.size = ranks, .hang_timeout = hang_timeout};
  if (simulate.empty()) {
    run_local_ranks(local, compare);
    return result;
  }
  const SimulatedCluster cluster = parse_simulation(simulate);
  local.ranks_per_host = cluster.ranks_per_host();
  run_local_ranks(local, [&](Communicator& comm) {
    SimulatedCommunicator simulated(comm, cluster);
    compare(simulated);
  });
  return result;
}

class CompareCommand final : public Command {
 public:
  [[nodiscard]] bool collective() const override { return true; }
  [[nodiscard]] std::string_view name() const override { return "compare"; }
  [[nodiscard]] std::string_view summary() const override {
    return "measure compositing strategies against each other on the same layers, and check that they agree";
  }

  void declare(const OptionSet& options) override { options_.declare(options); }

  ExitCode run(const Globals& globals) override {
    if (!options_.distributions.empty()) return compare_distributions(globals, options_);
    const CompareInput input = make_input(globals);
    options_.resolve();
    // The process that started this job has looked already.
    if (!hands_over()) options_.check_files(globals);
    return inside_mpi_job() ? run_in_job(globals, input) : run_here(globals, input);
  }

 private:
  [[nodiscard]] CompareInput make_input(const Globals& globals) const {
    const auto [screen, grid] = options_.wall_size(globals);
    if (options_.scene.empty() == options_.synthetic.empty()) {
      throw Error(ExitCode::Usage,
                  options_.scene.empty() ? "nothing to composite" : "a scene and --synthetic exclude each other",
                  "name a scene, or --synthetic dense|half|sparse|scatter|checker");
    }
    if (!options_.scene.empty()) return scene_layers(options_.scene, screen, grid, options_.local_shading(), globals);
    if (globals.seed > std::numeric_limits<std::uint32_t>::max()) {
      throw Error(ExitCode::Usage, fmt::format("--seed: synthetic layers take 32 bits, {} has more", globals.seed),
                  fmt::format("take one from 0 to {}", std::numeric_limits<std::uint32_t>::max()));
    }
    const SyntheticKind kind = parse_synthetic_kind(options_.synthetic);
    const auto seed = static_cast<std::uint32_t>(globals.seed);
    return {options_.synthetic, screen, grid, true,
            [=](Communicator& comm) { return synthetic_wall(kind, comm.rank(), screen, grid, seed); }};
  }

  /// Inside an MPI job: its ranks are the one number of ranks compared.
  [[nodiscard]] ExitCode run_in_job(const Globals& globals, const CompareInput& input) const {
    Globals job = globals;
    job.ranks = 0;
    return run_ranks(job, [&](Communicator& comm) {
      check_job_ranks(options_.rank_counts(), options_.ranks, comm.size());
      CompareResult result = compare_strategies(comm, input, options_.settings_for(comm.size()));
      return decide_on_root(comm, [&] {
        if (!hands_over()) return finish(globals, input, std::move(result));
        write_frame(result, input);
        hand_over(compare_columns(), std::span<const CompareRun>(result.runs));
        return verdict_on(result.runs);
      });
    });
  }

  /// One process: ranks are threads, or MPI jobs of this program that hand over their runs.
  [[nodiscard]] ExitCode run_here(const Globals& globals, const CompareInput& input) const {
    if (options_.on_threads()) return traced_alone(globals, [&] { return measure_here(globals, input); });
    return measure_here(globals, input);
  }

  [[nodiscard]] ExitCode measure_here(const Globals& globals, const CompareInput& input) const {
    CompareResult result;
    const std::vector<int> counts = options_.rank_counts();
    for (const int ranks : counts) check_memory(globals, input, ranks);  // all before any is measured
    for (std::size_t i = 0; i < counts.size(); ++i) {
      const int ranks = counts[i];
      std::vector<CompareRun> runs;
      if (options_.on_threads()) {
        CompareResult here =
            compare_on_threads(ranks, options_.simulate, globals.hang_limit(), input, options_.settings_for(ranks));
        runs = std::move(here.runs);
        result.frame = std::move(here.frame);
        result.picture = std::move(here.picture);
      } else {
        const bool last = i + 1 == counts.size();
        const JobResult job = run_measuring_job(globals, ranks, job_arguments(globals, ranks, last), kJobVariable, "1");
        if (!job.measured()) return job.code;
        runs = rows_from_job(compare_columns(), job.rows);
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
    const std::uint64_t pixel =
        options_.operation() == CompareOperator::OverFloat ? sizeof(RgbaPremultiplied) : sizeof(Key);
    const std::uint64_t layer = grid_layout(input.screen, input.grid).tiles() * kTilePixels * pixel;
    const std::uint64_t needed = layer * (3 * static_cast<std::uint64_t>(ranks) + 3);
    if (needed <= limit) return;
    throw Error(ExitCode::Limit,
                fmt::format("{} ranks need about {} of memory, {} may be used", ranks, format_bytes(needed),
                            format_bytes(limit)),
                "take fewer ranks, fewer screens or smaller ones");
  }

  /// What a job needs to run `ranks` of the rank counts; `last`: it also writes the frame.
  [[nodiscard]] std::vector<std::string> job_arguments(const Globals& globals, int ranks, bool last) const {
    std::vector<std::string> arguments = options_.arguments(globals);
    const auto add = [&](const std::string& option, const std::string& value) {
      arguments.push_back(option);
      arguments.push_back(value);
    };
    add("--ranks", std::to_string(ranks));
    if (last && !options_.picture.empty()) add("-o", options_.picture);
    if (last && !options_.raw.empty()) add("--raw", options_.raw);
    if (last && !globals.trace.empty()) add("--trace", globals.trace);
    if (!globals.limit_mem.empty()) add("--limit-mem", globals.limit_mem);
    if (!globals.limit_image.empty()) add("--limit-image", globals.limit_image);
    if (!globals.hang_timeout.empty()) add("--hang-timeout", globals.hang_timeout);
    if (globals.force) arguments.emplace_back("--force");
    for (int i = 0; i < globals.verbosity; ++i) arguments.emplace_back("-v");
    if (globals.verbosity < 0) arguments.emplace_back("-q");
    return arguments;
  }

  [[nodiscard]] static ExitCode verdict_on(const std::vector<CompareRun>& runs) {
    const bool differ = std::ranges::any_of(runs, [](const CompareRun& run) { return run.differing_pixels > 0; });
    return differ ? ExitCode::CheckFailed : ExitCode::Done;
  }

  /// Writes the files that were asked for; the result is without frames where a job has written them.
  void write_frame(const CompareResult& result, const CompareInput& input) const {
    if (!result.picture.pixels().empty() && !options_.picture.empty()) write_png(options_.picture, result.picture);
    if (result.frame.pixels().empty()) return;
    if (!options_.picture.empty()) write_png(options_.picture, frame_colors(result.frame, input.colors));
    if (!options_.raw.empty()) write_file_atomically(options_.raw, std::as_bytes(result.frame.pixels()));
  }

  [[nodiscard]] ExitCode finish(const Globals& globals, const CompareInput& input, CompareResult result) const {
    CompareReport report;
    report.machine = this_machine();
    report.screen = input.screen;
    report.grid = input.grid;
    report.input = input.name;
    report.operation = options_.operator_name;
    report.seed = globals.seed;
    std::vector<int> counts;
    for (const CompareRun& run : result.runs) {
      if (counts.empty() || counts.back() != run.ranks) counts.push_back(run.ranks);
    }
    std::vector<std::string> arguments = options_.arguments(globals);
    if (options_.simulate.empty()) {
      arguments.insert(arguments.end(), {"--ranks", fmt::format("{}", fmt::join(counts, ","))});
    }
    report.command = "hpr " + shell_line(arguments);
    report.runs = std::move(result.runs);
    write_frame(result, input);
    write_if_named(options_.csv, [&] { return compare_csv(report); });
    write_if_named(options_.html, [&] { return compare_html(report, draw_strategies(report.runs)); });
    std::fputs((options_.json ? compare_json(report) : compare_table(report)).c_str(), stdout);
    return verdict_on(report.runs);
  }

  CompareOptions options_;
};

}  // namespace

/// `hpr compare SCENE|--synthetic KIND`.
std::unique_ptr<Command> make_compare_command() {
  return std::make_unique<CompareCommand>();
}

}  // namespace hpr
