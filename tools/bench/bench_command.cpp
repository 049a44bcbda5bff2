#include <fmt/format.h>
#include <hpr/version.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <nlohmann/json.hpp>

#include "app/command.h"
#include "app/doctor/machine.h"
#include "app/launch/run_ranks.h"
#include "app/options/accuracy_options.h"
#include "core/job_environment.h"
#include "core/parallel.h"
#include "core/units.h"
#include "engine/output.h"
#include "raster/gl_context.h"
#include "tools/bench/bench_codec.h"
#include "tools/bench/bench_codec_frames.h"
#include "tools/bench/bench_frame.h"
#include "tools/bench/bench_net.h"
#include "tools/bench/bench_raster.h"
#include "tools/bench/bench_rays.h"
#include "tools/bench/bench_scale_command.h"
#include "tools/bench/bench_scene.h"

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
    codec_ = app.add_subcommand("codec", "picture codecs of one core on rendered frames, against the bare libraries");
    codec_->add_option("scene", codec_scenes_, "other scenes to draw (default: gen:gallery gen:cornell)");
    codec_->add_option("--size", codec_size_, "pixels of the frames")->capture_default_str()->type_name("WxH");
    codec_->add_option("--frames", codec_frames_, "of each sequence that deltas are measured on")
        ->check(CLI::Range(1, 1000))
        ->capture_default_str();
    scale_ = app.add_subcommand("scale", "the same frames by more and more ranks and cores, in the shape of table 6.1");
    scale_bench_.declare(*scale_);
    frame_ =
        app.add_subcommand("frame", "a whole frame of one rank, step by step, against bare GL, bare Embree and a copy");
    frame_bench_.declare(*frame_);
    for (CLI::App* const bench : {raster, net_, rays_, codec_, scale_, frame_}) {
      bench->add_flag("--json", json_, "one JSON document");
      bench->fallthrough();
    }
  }

  [[nodiscard]] bool collective() const override { return net_->parsed() || scale_->parsed(); }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    if (rays_->parsed()) return run_rays(globals);
    if (codec_->parsed()) return run_codec(globals);
    if (frame_->parsed()) {
      print(frame_bench_.run(globals), this_machine().cpu);
      return ExitCode::Done;
    }
    if (scale_->parsed()) return scale_bench_.run(globals, json_);
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
    if (side_ % kTileSide != 0) {
      throw Error(ExitCode::Usage, fmt::format("--side {} is no multiple of {}", side_, kTileSide),
                  fmt::format("use --side {}", side_ / kTileSide * kTileSide));
    }
    const Scene scene = scene_.empty() ? ray_bench_scene(triangles_) : load_scene(scene_, globals.scene_limits());
    print(bench_rays(scene, side_, build), this_machine().cpu);
    return ExitCode::Done;
  }

  [[nodiscard]] ExitCode run_codec(const Globals& globals) const {
    const auto extent = parse_extent(codec_size_);
    if (!extent) {
      throw Error(ExitCode::Usage, fmt::format("--size: '{}' is no size", codec_size_), "write e.g. 1280x720");
    }
    const Size size{extent->first, extent->second};
    check_size(size, globals.picture_limits());
    std::vector<BenchRow> rows;
    for (const std::string& scene : codec_scenes_) {
      const std::vector<BenchRow> more = bench_codec(draw_codec_frames(scene, size, codec_frames_, globals));
      rows.insert(rows.end(), more.begin(), more.end());
    }
    print(rows, this_machine().cpu);
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
      std::size_t width = 44;
      for (const BenchRow& row : rows) width = std::max(width, row.name.size());
      fmt::print("{:<{}} {:>10} {:>10} {:<6} {:>6}\n", "", width, "ours", "floor", "", "ratio");
      for (const BenchRow& row : rows) {
        if (row.floor > 0.0) {
          fmt::print("{:<{}} {:>10.2f} {:>10.2f} {:<6} {:>6.2f}\n", row.name, width, row.ours, row.floor, row.unit,
                     row.ratio);
        } else {
          fmt::print("{:<{}} {:>10.2f} {:>10} {:<6} {:>6}\n", row.name, width, row.ours, "-", row.unit, "-");
        }
      }
      return;
    }
    nlohmann::ordered_json json{
        {"schema", "hpr.bench/1"}, {"machine", machine}, {"commit", kCommit}, {"rows", nlohmann::json::array()}};
    for (const BenchRow& row : rows) {
      const auto known = [&](double value) { return row.floor > 0.0 ? nlohmann::json(value) : nlohmann::json(); };
      json["rows"].push_back({{"name", row.name},
                              {"ours", row.ours},
                              {"floor", known(row.floor)},
                              {"unit", row.unit},
                              {"ratio", known(row.ratio)}});
    }
    fmt::print("{}\n", json.dump(2));
  }

  CLI::App* net_ = nullptr;
  CLI::App* rays_ = nullptr;
  CLI::App* codec_ = nullptr;
  CLI::App* scale_ = nullptr;
  ScaleBench scale_bench_;
  CLI::App* frame_ = nullptr;
  FrameBench frame_bench_;
  std::vector<std::string> codec_scenes_{"gen:gallery", "gen:cornell"};
  std::string codec_size_ = "1280x720";
  int codec_frames_ = 4;
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
