#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "app/command.h"
#include "app/launch/run_ranks.h"
#include "app/options/render_options.h"
#include "app/results.h"
#include "cluster/transport/collectives.h"
#include "core/file.h"
#include "core/job_environment.h"
#include "core/log.h"
#include "core/progress.h"
#include "core/signals.h"
#include "core/text.h"
#include "core/timing.h"
#include "engine/checkpoint/checkpoint.h"
#include "engine/checkpoint/checkpoint_file.h"
#include "engine/frame_retry.h"
#include "engine/frame_sampler.h"
#include "engine/output.h"
#include "engine/session.h"

namespace hpr {
namespace {

class RenderCommand final : public Command {
 public:
  [[nodiscard]] bool collective() const override { return true; }
  [[nodiscard]] std::string_view name() const override { return "render"; }
  [[nodiscard]] std::string_view summary() const override { return "draw a scene into a picture"; }

  void declare(const OptionSet& options) override {
    options.option("scene", source_, "a .gltf or .glb file, or gen:NAME?key=value").required();
    options.option("-o,--output", files_.picture, "the picture: .png or .exr");
    options.option("--size", size_, "pixels of the picture").show_default().type("WxH");
    options.option("--raw", files_.raw,
                   "write the keys: per pixel a 64-bit word, depth above surface, row 0 at the top");
    options
        .option("--checkpoint", checkpoint_,
                "where SIGUSR1 (and stop) and SIGUSR2 (and go on) put the samples so far (default: OUTPUT.checkpoint)")
        .type("FILE");
    options
        .option("--checkpoint-every", checkpoint_every_,
                "how often they go there unasked, e.g. 30s; 0 or never: not at all")
        .type("DURATION")
        .show_default();
    options.flag("--resume", resume_, "go on with the samples of the checkpoint");
    declare_settings(options, settings_);
    settings_.finishes = true;
    report_.declare(options);
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override {
    const auto extent = parse_extent(size_);
    if (!extent) throw Error(ExitCode::Usage, fmt::format("--size: '{}' is no size", size_), "write e.g. 1920x1080");
    const Size size{extent->first, extent->second};
    check_size(size, globals.picture_limits());
    (void)checkpoint_interval();
    const RenderSettings settings = resolve(settings_, globals.seed);
    files_.aovs = settings.frame.aovs;
    files_.display = settings.display;
    files_.colors = settings.color_format;
    if (checkpoint_.empty() && !files_.picture.empty()) checkpoint_ = files_.picture + ".checkpoint";
    if (!settings.sampling.sums()) checkpoint_.clear();
    if (!inside_mpi_job()) {
      check_outputs(settings, globals);
      for (const std::string& sentence : unused_settings(settings)) log::warning("{}", sentence);
      if (settings.quality == Quality::Draft) note_what_is_left_out(settings);
      const int ranks = std::max(1, globals.ranks);
      if (settings.frame.groups > ranks) {
        log::warning("--groups {}: there are no more than {}, of one rank each", settings.frame.groups, ranks);
      }
    }
    watch_requests();
    return run_ranks(globals, [&](Communicator& comm) {
      if (inside_mpi_job()) check_on_root(comm, [&] { check_outputs(settings, globals); });
      Session session(comm, globals.session(), [&] { return load_scene(source_, settings, globals, size); });
      return draw(session, globals, settings, size);
    });
  }

 private:
  [[nodiscard]] std::chrono::nanoseconds checkpoint_interval() const {
    const auto interval =
        checkpoint_every_ == "never" ? std::chrono::nanoseconds::zero() : parse_duration(checkpoint_every_);
    if (interval) return *interval;
    throw Error(ExitCode::Usage, fmt::format("--checkpoint-every: '{}' is no duration", printable(checkpoint_every_)),
                "write e.g. 30s or 5min, or never");
  }

  void check_checkpoints(const Globals& globals) const {
    if (checkpoint_.empty()) return;
    for (const std::filesystem::path& path : {std::filesystem::path(checkpoint_), previous_checkpoint(checkpoint_)}) {
      std::error_code error;
      if (globals.force || resume_ || !std::filesystem::exists(path, error)) {
        check_writable(path, true);
      } else {
        throw Error(ExitCode::Io, fmt::format("'{}' exists: samples of an earlier run", printable(path.string(), 300)),
                    "--resume goes on with it, --force begins anew");
      }
    }
  }

  void check_outputs(const RenderSettings& settings, const Globals& globals) const {
    if (files_.picture.empty() && files_.raw.empty() && report_.stats.empty() && !report_.explain) {
      throw Error(ExitCode::Usage, "nothing to write", "name a picture with -o, or use --raw, --stats or --explain");
    }
    if (!files_.picture.empty() && !files_.picture.ends_with(".png") && !files_.picture.ends_with(".exr")) {
      throw Error(ExitCode::Usage, fmt::format("cannot write '{}': unknown picture format", files_.picture),
                  "name a .png or .exr file");
    }
    if (!files_.raw.empty()) check_raw(settings);
    if (files_.picture.ends_with(".exr") && settings.frame.shading == Shading::Local) {
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
    const std::vector<std::string> results{files_.picture, files_.raw, report_.stats, beside};
    std::vector<std::string> replaced = results;
    if (!checkpoint_.empty()) replaced.insert(replaced.end(), {checkpoint_, previous_checkpoint(checkpoint_).string()});
    check_distinct(replaced, globals.trace);
    check_spared(source_, globals.scene_limits(), std::span(&settings.environment, 1), replaced);
    for (const std::string& path : results) {
      if (!path.empty()) check_writable(path, globals.force);
    }
    check_checkpoints(globals);
  }

  /// Collective. On another machine, which has a GPU or has none, other choices may be made; a checkpoint says which
  /// they were.
  void choose_as_before(Communicator& comm, const Globals& globals, FrameSettings& chosen) const {
    struct Before {
      Primary primary = Primary::Auto;
      bool by_device = false;
    };
    Before before;
    check_on_root(comm, [&] {
      const StoredCheckpoint stored = read_checkpoint(checkpoint_);
      const RunIdentity identity = identity_in(stored.bytes, stored.path.string());
      before = {primary_of(identity), had_device(identity)};
    });
    before = all_gather_value(comm, before).front();
    if (chosen.primary == Primary::Auto) chosen.primary = before.primary;
    if (globals.backend == "auto" && !before.by_device) chosen.keys_by_device = chosen.light_by_device = false;
  }

  void print_plan(const FramePlan& plan) const {
    for (const std::string& line : plan.explained) fmt::print("{}\n", line);
    if (files_.colors != ColorFormat::Float32) fmt::print("{}\n", files_.explain_colors());
  }

  /// Collective. Draws the picture, once more where that fails; null where it stopped before its goal, with a
  /// checkpoint.
  [[nodiscard]] std::unique_ptr<FrameSampler> draw_samples(Session& session, const FramePlan& plan,
                                                           const Sampling& sampling, std::span<const View> views,
                                                           const CheckpointSettings& checkpoint,
                                                           Progress& progress) const {
    std::unique_ptr<FrameSampler> drawn;
    bool is_whole = false;
    const std::optional<Error> failure = draw_with_retry(session.comm(), "the picture", [&] {
      drawn.reset();  // frees its memory before the next one takes some
      drawn = std::make_unique<FrameSampler>(session, plan, sampling, 0, !files_.raw.empty());
      is_whole = drawn->draw(views, checkpoint, progress);
    });
    if (failure) throw AgreedError(*failure);
    return is_whole ? std::move(drawn) : nullptr;
  }

  ExitCode draw(Session& session, const Globals& globals, const RenderSettings& settings, Size size) {
    const Sampling& sampling = settings.sampling;
    const View view = make_view(choose_camera(settings.camera, session.scene()), size, session.scene().bounds);
    const Blocks blocks = cut_blocks(std::span(&view, 1), settings.frame.resolution_scale);
    FrameSettings chosen = settings.frame;
    chosen.single_picture = sampling.goal.one();
    if (resume_) choose_as_before(session.comm(), globals, chosen);
    FramePlan plan = plan_frame(session, chosen, blocks.views);
    plan.lit = !files_.picture.empty() || !report_.stats.empty();
    const bool is_root = session.comm().rank() == 0;
    if (report_.explain && is_root) print_plan(plan);
    if (files_.picture.empty() && files_.raw.empty() && report_.stats.empty()) return ExitCode::Done;

    prepare(session, plan);
    const Stopwatch watch;
    const std::size_t sent_before = session.comm().bytes_sent();
    Progress progress(is_root ? globals.progress : "none", "sample", sampling.goal.samples.value_or(0));
    std::optional<RunIdentity> identity;
    const CheckpointSettings checkpoint{.path = checkpoint_,
                                        .resume = resume_,
                                        .identity =
                                            [&] {
                                              if (!identity)
                                                identity = identity_of(session, plan, blocks.views, settings,
                                                                       !files_.raw.empty());
                                              return *identity;
                                            },
                                        .every = checkpoint_interval(),
                                        .keeps_previous = true};
    const std::unique_ptr<FrameSampler> drawn =
        draw_samples(session, plan, sampling, blocks.views, checkpoint, progress);
    if (!drawn) return ExitCode::Stopped;
    FrameSampler& sampler = *drawn;
    progress.end();
    const CollectedPicture picture(session, sampler.frame(), blocks, size, files_);
    const FrameCost cost{watch.ms(), session.comm().bytes_sent() - sent_before};
    RunStats stats = gather_stats(session, plan, sampler.times(), cost);
    stats.relmse = sampler.sample_progress().relmse;
    stats.display = picture.transform();
    stats.samples_in_all = static_cast<int>(sampler.sample_progress().samples);
    agree_on_failure(session.comm(), [&] {
      if (!is_root) return;
      picture.write(session.scene().name);
      if (!report_.stats.empty()) write_stats(report_.stats, stats);
      sampler.remove_unasked_checkpoints();
    });
    if (is_root) {
      log::info("{} triangles, {}x{} pixels, {} rank{}: {:.1f} ms{}", session.scene().triangles, size.width,
                size.height, stats.ranks, stats.ranks == 1 ? "" : "s", stats.ms,
                sampling.sums() ? fmt::format(", {} samples", sampler.sample_progress().samples) : "");
    }
    return verdict(stats, settings.strict);
  }

  std::string source_;
  std::string size_ = "1280x720";
  PictureFiles files_;
  std::string checkpoint_;
  std::string checkpoint_every_ = "5min";
  bool resume_ = false;
  RenderSettings settings_;
  ReportOptions report_;
};

}  // namespace

std::unique_ptr<Command> make_render_command() {
  return std::make_unique<RenderCommand>();
}

}  // namespace hpr
