#include <fmt/format.h>

#include "app/command.h"
#include "app/doctor/doctor.h"
#include "app/launch/run_ranks.h"
#include "app/options/render_options.h"
#include "core/job_environment.h"
#include "core/parallel.h"
#include "core/text.h"
#include "image/image_io.h"
#include "raster/gl_context.h"
#include "tools/bench/bench_codec.h"
#include "tools/bench/bench_codec_frames.h"
#include "tools/bench/bench_net.h"
#include "tools/bench/bench_raster.h"
#include "tools/bench/bench_rays.h"
#include "tools/bench/bench_rows.h"
#include "tools/bench/bench_scene.h"

namespace hpr {

std::unique_ptr<Command> make_bench_frame_command();
std::unique_ptr<Command> make_bench_scale_command();

namespace {

class BenchRasterCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "raster"; }
  [[nodiscard]] std::string_view summary() const override {
    return "a frame with raster only against a bare GL loop of the same mesh and readback";
  }

  void declare(const OptionSet& options) override { options.flag("--json", json_, "one JSON document"); }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    const int threads = globals.threads > 0 ? globals.threads : usable_cores();
    const auto context =
        make_gl_context({.backend = globals.backend, .device = globals.device, .local_rank = 0, .threads = threads});
    print_bench(bench_raster(*context, threads), context->description(), json_);
    return ExitCode::Done;
  }

 private:
  bool json_ = false;
};

class BenchNetCommand final : public Command {
 public:
  [[nodiscard]] bool collective() const override { return true; }
  [[nodiscard]] std::string_view name() const override { return "net"; }
  [[nodiscard]] std::string_view summary() const override {
    return "messages, merging and copying between two ranks, against plain MPI and a copy";
  }

  void declare(const OptionSet& options) override { options.flag("--json", json_, "one JSON document"); }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    Globals pair = globals;
    if (pair.ranks == 0 && !inside_mpi_job()) pair.ranks = 2;
    if (pair.ranks == 1)
      throw Error(ExitCode::Usage, "bench net needs two ranks", "leave --ranks out, or say --ranks 2");
    return run_ranks(pair, [&](Communicator& comm) {
      if (comm.size() < 2) throw Error(ExitCode::Usage, "bench net needs two ranks", "mpirun -n 2 hpr bench net");
      const std::vector<BenchRow> rows = bench_net(comm);
      if (comm.rank() == 0) print_bench(rows, this_machine().cpu, json_);
      return ExitCode::Done;
    });
  }

 private:
  bool json_ = false;
};

class BenchRaysCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "rays"; }
  [[nodiscard]] std::string_view summary() const override {
    return "rays of one thread as passes trace them, against a bare Embree loop";
  }

  void declare(const OptionSet& options) override {
    const Option scene = options.option("scene", scene_, "another scene to trace");
    options.option("--triangles", triangles_, "of the largest mesh of the scene made for it")
        .range(std::uint64_t{100}, std::uint64_t{100'000'000})
        .show_default()
        .excludes(scene);
    options.option("--side", side_, "pixels of the square picture, a multiple of 64").range(64, 8192).show_default();
    for (const char* const name : {"embree-quality", "deterministic"}) {
      declare_setting(options, settings_, *find_setting(name));
    }
    options.flag("--json", json_, "one JSON document");
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    const RayBuild build = settings_.frame.rays.build;
    if (side_ % kTileSide != 0) {
      throw Error(ExitCode::Usage, fmt::format("--side {} is no multiple of {}", side_, kTileSide),
                  fmt::format("use --side {}", side_ / kTileSide * kTileSide));
    }
    const Scene scene = scene_.empty() ? ray_bench_scene(triangles_) : load_scene(scene_, globals.scene_limits());
    print_bench(bench_rays(scene, side_, build), this_machine().cpu, json_);
    return ExitCode::Done;
  }

 private:
  std::string scene_;
  std::uint64_t triangles_ = 1'000'000;
  int side_ = 1024;
  RenderSettings settings_;
  bool json_ = false;
};

class BenchCodecCommand final : public Command {
 public:
  [[nodiscard]] std::string_view name() const override { return "codec"; }
  [[nodiscard]] std::string_view summary() const override {
    return "picture codecs of one core on rendered frames, against the bare libraries";
  }

  void declare(const OptionSet& options) override {
    options.option("scene", scenes_, "other scenes to draw (default: gen:gallery gen:cornell)");
    options.option("--size", size_, "pixels of the frames").show_default().type("WxH");
    options.option("--frames", frames_, "of each sequence that deltas are measured on").range(1, 1000).show_default();
    options.flag("--json", json_, "one JSON document");
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    const auto extent = parse_extent(size_);
    if (!extent) {
      throw Error(ExitCode::Usage, fmt::format("--size: '{}' is no size", size_), "write e.g. 1280x720");
    }
    const Size size{extent->first, extent->second};
    check_size(size, globals.picture_limits());
    std::vector<BenchRow> rows;
    for (const std::string& scene : scenes_) {
      const std::vector<BenchRow> more = bench_codec(draw_codec_frames(scene, size, frames_, globals));
      rows.insert(rows.end(), more.begin(), more.end());
    }
    print_bench(rows, this_machine().cpu, json_);
    return ExitCode::Done;
  }

 private:
  std::vector<std::string> scenes_{"gen:gallery", "gen:cornell"};
  std::string size_ = "1280x720";
  int frames_ = 4;
  bool json_ = false;
};

/// Our figure beside a floor's or a peer's, as a ratio of speeds: 1 is equal, more is faster (docs/commands.md).
class BenchCommand final : public CommandGroup {
 public:
  BenchCommand() : CommandGroup("bench", "our speed beside a floor's or a peer's, as ratios") {}
  [[nodiscard]] std::vector<std::unique_ptr<Command>> subcommands() const override {
    auto all = commands_of<BenchRasterCommand, BenchNetCommand, BenchRaysCommand, BenchCodecCommand>();
    all.push_back(make_bench_scale_command());
    all.push_back(make_bench_frame_command());
    return all;
  }
};

}  // namespace

std::unique_ptr<Command> make_bench_command() {
  return std::make_unique<BenchCommand>();
}

}  // namespace hpr
