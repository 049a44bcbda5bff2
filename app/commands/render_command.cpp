#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <limits>
#include <optional>

#include "app/command.h"
#include "app/launch/run_ranks.h"
#include "app/options/render_options.h"
#include "app/output_files.h"
#include "app/stats_file.h"
#include "cluster/transport/agreement.h"
#include "cluster/transport/collectives.h"
#include "core/file.h"
#include "core/job_environment.h"
#include "core/log.h"
#include "core/stopwatch.h"
#include "core/units.h"
#include "engine/frame_sampler.h"
#include "engine/output.h"
#include "engine/picture_files.h"
#include "engine/resolution.h"
#include "engine/run_identity.h"
#include "engine/signals.h"

namespace hpr {
namespace {

class RenderCommand final : public Command {
 public:
  [[nodiscard]] bool collective() const override { return true; }
  [[nodiscard]] std::string_view name() const override { return "render"; }
  [[nodiscard]] std::string_view summary() const override { return "draw a scene into a picture"; }

  void declare(CLI::App& app) override {
    app.add_option("scene", source_, "a .gltf or .glb file, or gen:NAME?key=value")->required();
    app.add_option("-o,--output", files_.picture, "the picture: .png or .exr");
    app.add_option("--size", size_, "pixels of the picture")->capture_default_str()->type_name("WxH");
    app.add_option("--raw", files_.raw,
                   "write the keys: per pixel a 64-bit word, depth above surface, row 0 at the top");
    app.add_option(
           "--checkpoint", checkpoint_,
           "where SIGUSR1 (and stop) and SIGUSR2 (and go on) put the samples so far (default: OUTPUT.checkpoint)")
        ->type_name("FILE");
    app.add_flag("--resume", resume_, "go on with the samples of the checkpoint");
    options_.declare(app);
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    const auto extent = parse_extent(size_);
    if (!extent) throw Error(ExitCode::Usage, fmt::format("--size: '{}' is no size", size_), "write e.g. 1920x1080");
    const Size size{extent->first, extent->second};
    check_size(size, globals.picture_limits());
    const FrameSettings settings = options_.settings(globals.seed);
    const Sampling sampling = options_.sampling();
    files_.aovs = settings.aovs;
    files_.exposure = options_.exposure;
    files_.colors = options_.wire.colors();
    if (checkpoint_.empty() && !files_.picture.empty()) checkpoint_ = files_.picture + ".checkpoint";
    if (!sampling.sums()) checkpoint_.clear();
    if (!inside_mpi_job()) {
      check_outputs(globals);
      for (const std::string& option : options_.without_use()) {
        log::warning("{} has no use for {}", options_.reference ? "--reference" : "--passes " + options_.passes,
                     option);
      }
      warn_of_groups(settings, std::max(1, globals.ranks));
    }
    watch_requests();
    return run_ranks(globals, [&](Communicator& comm) {
      if (inside_mpi_job()) check_on_root(comm, [&] { check_outputs(globals); });
      Session session(comm, globals.session(), [&] { return options_.load(source_, globals); });
      return draw(session, globals, settings, sampling, size);
    });
  }

 private:
  /// Of any distribution but hybrid, which `auto` may choose, they are none of its business.
  void warn_of_groups(const FrameSettings& settings, int ranks) const {
    if (settings.distribution.value_or(Distribution::Hybrid) != Distribution::Hybrid && settings.groups > 0) {
      log::warning("--distribute {} has no use for --groups", options_.distribute);
    } else if (settings.groups > ranks) {
      log::warning("--groups {}: there are no more than {}, of one rank each", settings.groups, ranks);
    }
  }

  void check_outputs(const Globals& globals) const {
    if (files_.picture.empty() && files_.raw.empty() && options_.stats.empty() && !options_.explain) {
      throw Error(ExitCode::Usage, "nothing to write", "name a picture with -o, or use --raw, --stats or --explain");
    }
    if (!files_.picture.empty() && !files_.picture.ends_with(".png") && !files_.picture.ends_with(".exr")) {
      throw Error(ExitCode::Usage, fmt::format("cannot write '{}': unknown picture format", files_.picture),
                  "name a .png or .exr file");
    }
    if (!files_.raw.empty()) check_raw(options_);
    if (files_.picture.ends_with(".exr") && options_.shading == "local") {
      log::warning("--shading local composites 8-bit display colours: '{}' will hold no more than those",
                   files_.picture);
    }
    if (!files_.aovs.empty() && files_.picture.empty()) {
      throw Error(ExitCode::Usage, "--aov needs a picture its layers go with", "name one with -o");
    }
    if (resume_ && checkpoint_.empty()) {
      throw Error(ExitCode::Usage, "--resume goes on with the samples of a picture of several",
                  "ask for more with --spp, and name the picture with -o or the file with --checkpoint");
    }
    const std::string beside = files_.is_png() ? files_.aov_file() : "";
    const std::vector<std::string> results{files_.picture, files_.raw, options_.stats, beside, checkpoint_};
    check_distinct(results, globals.trace);
    check_spared(source_, globals.scene_limits(), std::span(&options_.environment, 1), results);
    for (const std::string& path : results) {
      if (!path.empty()) check_writable(path, globals.force || (resume_ && path == checkpoint_));
    }
  }

  /// Measured again, the choice may be another one; a checkpoint says which it was.
  [[nodiscard]] Primary primary_before(Communicator& comm) const {
    Primary primary = Primary::Auto;
    check_on_root(comm, [&] {
      primary = primary_of(identity_in(read_file(checkpoint_, std::numeric_limits<std::uint64_t>::max()), checkpoint_));
    });
    return all_gather_value(comm, primary).front();
  }

  void print_plan(const FramePlan& plan) const {
    for (const std::string& line : plan.explained) fmt::print("{}\n", line);
    if (files_.colors != ColorFormat::Float32) fmt::print("{}\n", files_.explain_colors());
  }

  ExitCode draw(Session& session, const Globals& globals, const FrameSettings& settings, const Sampling& sampling,
                Size size) {
    const View view = make_view(options_.choose_camera(session.scene()), size, session.scene().bounds);
    const Blocks blocks = cut_blocks(at_resolution(std::span(&view, 1), settings.resolution_scale));
    FrameSettings chosen = settings;
    if (resume_ && settings.primary == Primary::Auto) chosen.primary = primary_before(session.comm());
    FramePlan plan = plan_frame(session, chosen, blocks.views);
    plan.lit = !files_.picture.empty() || !options_.stats.empty();
    const bool speaks = session.comm().rank() == 0;
    if (options_.explain && speaks) print_plan(plan);
    if (files_.picture.empty() && files_.raw.empty() && options_.stats.empty()) return ExitCode::Done;

    prepare(session, plan);
    const Stopwatch watch;
    const std::size_t sent_before = session.comm().bytes_sent();
    FrameSampler sampler(session, plan, sampling, 0, !files_.raw.empty());
    Progress progress(speaks ? globals.progress : "none", "sample", sampling.goal.samples.value_or(0));
    std::optional<RunIdentity> identity;
    const CheckpointSettings checkpoint{checkpoint_, resume_, [&] {
                                          if (!identity)
                                            identity =
                                                identity_of(session, plan, blocks.views, sampling, !files_.raw.empty());
                                          return *identity;
                                        }};
    if (!sampler.draw(blocks.views, checkpoint, progress)) return ExitCode::Stopped;
    progress.end();
    const CollectedPicture picture(session, sampler.frame(), blocks, size, files_);
    const FrameCost cost{watch.ms(), session.comm().bytes_sent() - sent_before};
    RunStats stats = gather_stats(session, plan, sampler.times(), cost);
    stats.relmse = sampler.reached_so_far().relmse;
    stats.samples_in_all = static_cast<int>(sampler.reached_so_far().samples);
    agree_on_failure(session.comm(), [&] {
      if (!speaks) return;
      picture.write(session.scene().name);
      if (!options_.stats.empty()) write_stats(options_.stats, stats);
    });
    if (speaks) {
      log::info("{} triangles, {}x{} pixels, {} rank{}: {:.1f} ms{}", session.scene().triangles, size.width,
                size.height, stats.ranks, stats.ranks == 1 ? "" : "s", stats.ms,
                sampling.sums() ? fmt::format(", {} samples", sampler.reached_so_far().samples) : "");
    }
    return verdict(stats, options_.strict);
  }

  std::string source_;
  std::string size_ = "1280x720";
  PictureFiles files_;
  std::string checkpoint_;
  bool resume_ = false;
  RenderOptions options_;
};

}  // namespace

std::unique_ptr<Command> make_render_command() {
  return std::make_unique<RenderCommand>();
}

}  // namespace hpr
