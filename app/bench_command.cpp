#include "app/bench_command.h"

#include <fmt/format.h>
#include <hpr/version.h>

#include <nlohmann/json.hpp>

#include "app/accuracy_options.h"
#include "app/bench_net.h"
#include "app/bench_raster.h"
#include "app/bench_rays.h"
#include "app/bench_scene.h"
#include "app/launcher.h"
#include "app/machine.h"
#include "core/parallel.h"
#include "raster/gl_context.h"

namespace hpr {
namespace {

/// Our figure beside the floor's or a peer's, as a ratio of speeds: 1 is equal, more is faster (docs/cli.md).
class BenchCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "bench"; }
  [[nodiscard]] std::string_view summary() const override {
    return "our speed beside a floor's or a peer's, as ratios";
  }

  void declare(CLI::App& app) override {
    app.require_subcommand(1);
    CLI::App* const raster =
        app.add_subcommand("raster", "a frame with raster only against a bare GL loop of the same mesh and readback");
    net_ = app.add_subcommand("net", "messages, merging and copying between two ranks, against plain MPI and a copy");
    rays_ = app.add_subcommand("rays", "rays of one thread as passes trace them, against a bare Embree loop");
    CLI::Option* const scene = rays_->add_option("scene", scene_, "another scene to trace");
    rays_->add_option("--triangles", triangles_, "of the largest mesh of the scene made for it")
        ->check(CLI::Range(100, 100'000'000))
        ->capture_default_str()
        ->excludes(scene);
    rays_->add_option("--side", side_, "pixels of the square picture, a multiple of 64")
        ->check(CLI::Range(64, 8192))
        ->capture_default_str();
    ray_build_.declare(*rays_);
    for (CLI::App* const bench : {raster, net_, rays_}) {
      bench->add_flag("--json", json_, "one JSON document");
      bench->fallthrough();
    }
  }

  [[nodiscard]] bool collective() const override { return net_->parsed(); }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    if (rays_->parsed()) return run_rays(globals);
    return net_->parsed() ? run_net(globals) : run_raster(globals);
  }

 private:
  [[nodiscard]] ExitCode run_raster(const Globals& globals) const {
    const int threads = globals.threads > 0 ? globals.threads : usable_cores();
    const auto context =
        make_gl_context({.backend = globals.backend, .device = globals.device, .local_rank = 0, .threads = threads});
    print(bench_raster(*context, threads), context->description());
    return ExitCode::Done;
  }

  [[nodiscard]] ExitCode run_rays(const Globals& globals) const {
    const RayBuild build = ray_build_.build();
    const Scene scene = scene_.empty() ? ray_bench_scene(triangles_) : load_scene(scene_, globals.scene_limits());
    print(bench_rays(scene, side_ / kTileSide * kTileSide, build), this_machine().cpu);
    return ExitCode::Done;
  }

  [[nodiscard]] ExitCode run_net(const Globals& globals) const {
    Globals pair = globals;
    if (pair.ranks == 0 && !inside_mpi_job()) pair.ranks = 2;
    if (pair.ranks == 1)
      throw Error(ExitCode::Usage, "bench net needs two ranks", "leave --ranks out, or say --ranks 2");
    return run_ranks(pair, [&](Communicator& comm) {
      if (comm.size() < 2) throw Error(ExitCode::Usage, "bench net needs two ranks", "mpirun -n 2 hpr bench net");
      const std::vector<BenchRow> rows = bench_net(comm);
      if (comm.rank() == 0) print(rows, this_machine().cpu);
      return ExitCode::Done;
    });
  }

  void print(const std::vector<BenchRow>& rows, const std::string& machine) const {
    if (!json_) {
      fmt::print("{:<44} {:>10} {:>10} {:<6} {:>6}\n", "", "ours", "floor", "", "ratio");
      for (const BenchRow& row : rows) {
        fmt::print("{:<44} {:>10.2f} {:>10.2f} {:<6} {:>6.2f}\n", row.name, row.ours, row.floor, row.unit, row.ratio);
      }
      return;
    }
    nlohmann::ordered_json json{
        {"schema", "hpr.bench/1"}, {"machine", machine}, {"commit", kCommit}, {"rows", nlohmann::json::array()}};
    for (const BenchRow& row : rows) {
      json["rows"].push_back(
          {{"name", row.name}, {"ours", row.ours}, {"floor", row.floor}, {"unit", row.unit}, {"ratio", row.ratio}});
    }
    fmt::print("{}\n", json.dump(2));
  }

  CLI::App* net_ = nullptr;
  CLI::App* rays_ = nullptr;
  std::string scene_;
  std::uint64_t triangles_ = 1'000'000;
  int side_ = 1024;
  RayBuildOptions ray_build_;
  bool json_ = false;
};

}  // namespace

std::unique_ptr<Command> make_bench_command() {
  return std::make_unique<BenchCommand>();
}

}  // namespace hpr
