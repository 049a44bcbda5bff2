#include "app/commands/wall_run.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <optional>
#include <thread>

#include "app/command.h"
#include "app/launch/launcher.h"
#include "app/launch/run_ranks.h"
#include "app/results.h"
#include "cluster/transport/collectives.h"
#include "core/file.h"
#include "core/job_environment.h"
#include "core/log.h"
#include "core/progress.h"
#include "core/signals.h"
#include "core/text.h"
#include "core/timing.h"
#include "engine/output.h"
#include "engine/wall/viewpoint.h"
#include "engine/wall/wall_driver.h"
#include "engine/wall/wall_status.h"
#include "image/image_io.h"
#include "rt/passes/pass_list.h"
#include "walls/config/wall_file.h"
#include "walls/displays/display.h"
#include "walls/drawing/assemble.h"
#include "walls/geometry/geometry.h"
#include "walls/link/sender.h"
#include "walls/manifest/manifest.h"
#include "walls/manifest/run_journal.h"

namespace hpr {
namespace {

/// How well the target time was kept.
void report_budget(const RunManifest& manifest) {
  std::vector<double> ms;
  double target_ms = 0.0;
  std::map<std::string, std::size_t> given_up;
  for (const FrameRecord& frame : manifest.frames) {
    if (!frame.budget || frame.budget->resting) continue;
    target_ms = frame.budget->target_ms;
    ms.push_back(frame.ms);
    for (const std::string& what : frame.budget->given_up) ++given_up[what];
  }
  if (ms.empty()) return;
  std::ranges::sort(ms);
  const auto within = [&](std::size_t percent) { return ms[(percent * ms.size() + 99) / 100 - 1]; };  // nearest rank
  std::vector<std::string> parts;
  parts.reserve(given_up.size());
  for (const auto& [what, frames] : given_up) parts.push_back(fmt::format("{} in {}", what, frames));
  log::info("{} frames: half took up to {:.1f} ms, 95 % up to {:.1f} ms, target {:.1f} ms; given up: {}", ms.size(),
            within(50), within(95), target_ms, parts.empty() ? "nothing" : fmt::format("{}", fmt::join(parts, ", ")));
}

void print_summary(const RunStats& stats, const Wall& wall, const Scene& scene) {
  fmt::print("scene      {}: {} triangles, {} instances, {} lights\n", printable(scene.name), scene.triangles,
             scene.instances.size(), scene.lights.size());
  std::size_t pixels = 0;
  for (const WallScreen& screen : wall.screens) pixels += screen.pixels.area();
  fmt::print("wall       {} screens, {:.2f} million pixels, {} rank{}\n", wall.screens.size(),
             static_cast<double>(pixels) * 1e-6, stats.ranks, stats.ranks == 1 ? "" : "s");
  for (const PassTime& time : stats.times) fmt::print("{:<10} {:7.1f} ms\n", time.name, time.ms);
  for (const PassPlan& pass : stats.passes) {
    if (!pass.runs) fmt::print("{:<10} off: {}\n", name_of(pass.pass), pass.why);
  }
  fmt::print("frame      {:7.1f} ms, {} shadow and {} reflection rays\n", stats.ms, stats.rays[PassId::Shadow],
             stats.rays[PassId::Reflection]);
}

/// Rank 0's files of a finished run: the assembled wall and what was done.
void write_results(const WallJob& job, const WallDriver& driver, const RunStats& stats,
                   std::span<const Image<Rgba8>> pictures) {
  const WallOutputs& outputs = job.outputs;
  if (!outputs.assembled.empty() || !outputs.picture.empty()) {
    const std::vector<std::byte> picture = encode_png(
        draw_wall(job.wall, wall_picture(job.wall, kMaxPictureSide), pictures), texts_of(driver.transform()));
    if (!outputs.assembled.empty()) write_file_atomically(outputs.assembled, picture);
    if (!outputs.picture.empty()) write_file_atomically(outputs.picture, picture);
  }
  if (!outputs.manifest.empty()) write_file_atomically(outputs.manifest, to_json(driver.manifest()));
  if (!outputs.stats.empty()) write_stats(outputs.stats, stats);
}

/// Collective. Follows the viewers and applies commands until there is a frame to draw; false when they ended the run.
bool wait_for_work(const WallJob& job, WallDriver& driver) {
  constexpr std::chrono::milliseconds kBetweenPolls{10};
  // Displays outside the job take a run that sends nothing for one that is gone. Counted, so that all ranks agree.
  constexpr int kPollsBeforeHeartbeat = 30;
  for (int poll = 0;; ++poll) {
    if (!driver.follow_viewers() || !driver.apply_commands()) return false;
    if (!job.open_ended() || !driver.settled()) return true;
    if (job.link && poll == kPollsBeforeHeartbeat) return true;
    std::this_thread::sleep_for(kBetweenPolls);
  }
}

/// Collective. Throws Error (BadInput) where hosts hold different wall files.
void check_same_wall(Communicator& comm, const Wall& wall, const std::string& file) {
  const auto hashes = all_gather_value(comm, wall.hash);
  for (std::size_t rank = 0; rank < hashes.size(); ++rank) {
    if (hashes[rank] != hashes[0]) {
      throw Error(ExitCode::BadInput, fmt::format("rank {} read another '{}' than rank 0", rank, file),
                  "give every host the same wall file");
    }
  }
}

/// Collective. Draws until the last frame, where the run is not open-ended, or until somebody ends it; whether it was
/// ended before its last frame. `mode`: how progress is shown.
bool draw_frames(const WallJob& job, WallDriver& driver, const std::string& mode) {
  const Sampling sampling = sampling_of(job, resolve(job.settings, job.seed));
  const int frames = job.open_ended() ? 0 : job.frame_count();
  // A terminal has room for one bar: that of the samples, where there are several.
  const bool shows_samples = sampling.sums() && (mode != "auto" || stderr_is_terminal());
  WallStatus status(shows_samples ? "none" : mode, driver.first_frame(), static_cast<std::size_t>(frames));
  for (int frame = static_cast<int>(driver.first_frame()); frame < frames || job.open_ended();) {
    Progress samples(sampling.sums() ? mode : "none", fmt::format("frame {}: sample", frame + 1),
                     sampling.goal.samples.value_or(0));
    const Stopwatch watch;
    if (driver.draw(static_cast<std::uint64_t>(frame), samples)) {
      status.add(watch.ms(), driver.manifest().frames.back(), [&] { return driver.states(); });
      ++frame;
    }
    const bool last = !job.open_ended() && frame >= frames;
    if (!last && !wait_for_work(job, driver)) return !job.open_ended();
  }
  return false;
}

/// What a run prints at its end: what was done, if asked, and where its result is. `stopped`: before its last frame.
void print_end(const WallJob& job, const WallDriver& driver, bool stopped, const RunStats& stats, const Scene& scene) {
  const WallOutputs& outputs = job.outputs;
  if (stopped) {
    log::info("stopped after frame {} of {}{}", driver.manifest().frames.back().frame + 1, job.frame_count(),
              outputs.manifest.empty() ? "" : "; --resume goes on");
  }
  if (job.summary) print_summary(stats, job.wall, scene);
  for (const auto& result : {outputs.picture, outputs.assembled, outputs.manifest}) {
    if (result.empty()) continue;
    fmt::print("{}\n", result.string());
    return;
  }
}

/// Collective. The layers of the last frame, if that was drawn.
void write_last_layers(const WallJob& job, WallDriver& driver, Session& session) {
  if (driver.failed().in_a_row() == 0) {
    write_layers(job.outputs.layers, driver.plan().aovs, driver, session);
  } else if (!job.outputs.layers.empty() && session.rank() == 0) {
    log::warning("the last frame failed: there are no files of its layers");
  }
}

ExitCode drive(const WallJob& job, const Globals& globals, Session& session) {
  const bool reports = session.comm().rank() == 0;
  check_same_wall(session.comm(), job.wall, job.wall_file);
  WallDriver driver(job, session);
  if (job.explain && reports) {
    fmt::print("{}\n", fmt::join(driver.explained(), "\n"));
    std::fflush(stdout);  // a pipe of the launcher's
  }
  prepare(session, driver.plan());
  const bool ended_early = draw_frames(job, driver, reports && globals.verbosity >= 0 ? globals.progress : "none");
  if (ended_early) driver.note_stop(job.frame_count());
  const bool stopped = ended_early && driver.interrupted();
  const bool seen = driver.finish();
  RunStats stats = gather_stats(session, driver.plan(), driver.times(), driver.last_cost());
  stats.relmse = driver.relmse();
  stats.budget = driver.frames().report();
  stats.display = driver.transform();
  if (reports && stats.budget) report_budget(driver.manifest());
  write_last_layers(job, driver, session);
  std::vector<Image<Rgba8>> pictures;
  if (!job.outputs.assembled.empty() || !job.outputs.picture.empty()) pictures = driver.collect_pictures();
  agree_on_failure(session.comm(), [&] {
    if (reports) write_results(job, driver, stats, pictures);
  });
  if (!seen) return ExitCode::Lost;
  if (reports) print_end(job, driver, stopped, stats, session.scene());
  if (reports && driver.failed().count() > 0) {
    log::error("{}; the screens kept the pictures of the frames before", driver.failed().describe());
  }
  if (stopped && !job.outputs.manifest.empty()) return ExitCode::Stopped;
  return driver.failed().count() > 0 ? ExitCode::CheckFailed : verdict(stats, job.settings.strict);
}

/// Beside the scene's.
std::vector<std::string> files_read(const WallRun& run, const Wall& wall) {
  std::vector<std::string> files{run.wall, run.path, run.settings.environment};
  const std::filesystem::path folder = std::filesystem::path(run.wall).parent_path();
  for (const WallScreen& screen : wall.screens) {
    for (const WarpFile* const file : {&screen.warp.mesh, &screen.warp.blend, &screen.warp.black}) {
      if (!file->path.empty()) files.push_back((folder / file->path).string());
    }
  }
  for (const WallViewer& viewer : wall.viewers) files.push_back(viewer.tracker.file);
  return files;
}

/// A result in a folder that the run makes where it is missing.
void check_result(const std::filesystem::path& file, bool overwrite) {
  std::error_code error;
  check_folder(file.parent_path());
  if (std::filesystem::exists(file.parent_path(), error)) check_writable(file, overwrite);
}

/// Throws Error where a result cannot be written, or would take the place of a file that is read or of another result.
void check_outputs(const WallJob& job, const Globals& globals) {
  const WallOutputs& outputs = job.outputs;
  std::vector<std::string> results{outputs.picture.string(), outputs.stats.string(), outputs.manifest.string(),
                                   outputs.assembled.string()};
  const std::string stream = job.display_options.pipe.file.string();
  if (job.display->stream && stream != "-") results.push_back(stream);
  if (!outputs.assembled.empty()) {
    for (const auto& file : files_of_display(job.wall, job.display_options.folder)) results.push_back(file.string());
  }
  results.insert(results.end(), outputs.layers.aov.begin(), outputs.layers.aov.end());
  results.insert(results.end(), outputs.layers.raw.begin(), outputs.layers.raw.end());
  check_distinct(results, globals.trace);
  check_spared(job.scene, globals.scene_limits(), job.inputs, results);

  for (const auto& file : {outputs.picture, outputs.stats}) {
    if (!file.empty()) check_writable(file, globals.force);
  }
  job.display->check(job.wall, job.display_options);
  for (const auto& file : {outputs.manifest, outputs.assembled}) {
    if (!file.empty()) check_result(file, globals.force);
  }
  for (const std::string& file : outputs.layers.aov) check_result(file, globals.force);
  for (const std::string& file : outputs.layers.raw) check_writable(file, globals.force);
}

/// Throws Error where the camera's path and other options exclude each other, or it has no direction somewhere.
[[nodiscard]] CameraPath load_path(const WallRun& run, const WallJob& job) {
  if (run.settings.is_given("camera") || run.settings.is_given("eye")) {
    throw Error(ExitCode::Usage, "--path says where the camera is, as do --camera and --eye", "use one of them");
  }
  if (job.open_ended()) {
    throw Error(ExitCode::Usage, "--path needs to know how many frames it takes", "add --frames N");
  }
  CameraPath path = load_camera_path(run.path);
  check_directions(path, static_cast<std::size_t>(job.frame_count()), run.path);
  return path;
}

void check_targets(const WallRun& run) {
  for (const auto& target : {run.target_ms, run.target_error}) {
    if (target && !std::isfinite(*target)) {
      throw Error(ExitCode::Usage, "--target-ms and --target-error take finite numbers", "write e.g. --target-ms 33");
    }
  }
  if (run.target_error && !(*run.target_error >= 1e-12 && *run.target_error <= 1e12)) {
    throw Error(ExitCode::Usage, fmt::format("--target-error {:g} is not from 1e-12 to 1e12", *run.target_error),
                "write e.g. --target-error 1e-3");
  }
}

/// Throws Error (Usage) for options that exclude each other.
void check_together(const WallRun& run, const WallJob& job) {
  if (run.display.frames_on_stdout() && job.explain) {
    throw Error(ExitCode::Usage, "--explain writes to standard output, where the frames go",
                "leave it out, or send the frames elsewhere");
  }
  if (!run.picture.empty() && !run.picture.ends_with(".png")) {
    throw Error(ExitCode::Usage, fmt::format("cannot write '{}': the assembled wall is a PNG", run.picture),
                "name a .png file");
  }
  if (job.resume && (job.open_ended() || job.outputs.manifest.empty())) {
    throw Error(ExitCode::Usage, "--resume needs to know how many frames it goes on to, and which run with",
                "use it with --frames N, --display file or remote, and -o DIR");
  }
}

/// Where a run's results go.
[[nodiscard]] WallOutputs outputs_of(const WallRun& run, const WallJob& job, const RenderSettings& settings) {
  const std::filesystem::path folder = run.display.output;
  WallOutputs outputs{.picture = run.picture, .stats = run.report.stats};
  const bool writes_files = run.display.writes_files();
  if (writes_files || (job.link && !folder.empty())) outputs.manifest = folder / "manifest.json";
  if (writes_files) outputs.assembled = folder / "wall.png";
  outputs.layers = layer_files(job, settings, folder, run.raw);
  return outputs;
}

/// The folder that a run makes where it is missing; empty: none.
[[nodiscard]] std::filesystem::path folder_of(const WallJob& job) {
  return job.outputs.manifest.parent_path();
}

/// Makes the folder of the results and keeps other runs out of it. A job that another process of this program launched
/// has it from there.
void claim_folder(const WallJob& job, std::optional<FolderLock>& lock) {
  if (folder_of(job).empty()) return;
  std::error_code error;
  std::filesystem::create_directories(folder_of(job), error);
  if (error) {
    throw Error(ExitCode::Io, fmt::format("cannot make the folder '{}': {}", folder_of(job).string(), error.message()),
                "name a folder that can be written with -o");
  }
  if (!job.outputs.assembled.empty() && !launched_by_hpr()) lock.emplace(folder_of(job));
}

}  // namespace

WallJob make_wall_job(const WallRun& run, const Globals& globals) {
  const int restarts = run.display.kind().stream ? 0 : run.restarts;
  WallJob job{.wall = load_wall(run.wall, run.overrides, !starts_ranks(globals, restarts)),
              .wall_file = run.wall,
              .scene = run.scene,
              .settings = run.settings,
              .seed = globals.seed,
              .picture_limits = globals.picture_limits()};
  if (run.scale != 1.0) job.wall = scale_wall(std::move(job.wall), run.scale);
  for (const WallScreen& screen : job.wall.screens) check_size(screen.pixels, job.picture_limits);
  for (const WallMonitor& monitor : job.wall.monitors) check_size(monitor.pixels, job.picture_limits);
  job.display = &run.display.kind();
  job.display_options = run.display.options(globals);
  job.frames = run.frames;
  job.until_stopped = run.until_stopped;
  job.resume = run.resume;
  check_targets(run);
  job.target_ms = run.target_ms;
  job.target_relmse = run.target_error;
  if (!run.path.empty()) job.path = load_path(run, job);
  job.load = [globals, wall = job.wall, path = job.path, frames = job.frame_count()](const std::string& source,
                                                                                     const RenderSettings& settings) {
    return load_scene(source, settings, globals, [&](const Scene& scene) {
      const Camera camera =
          path ? camera_of(path->at_frame(0, static_cast<std::size_t>(frames))) : choose_camera(settings.camera, scene);
      return wall_views(wall, camera, scene.bounds);
    });
  };
  if (run.display.remote()) {
    job.link = run.link.settings(job.wall, run.settings.codec);
  } else {
    run.link.refuse();
  }
  job.outputs = outputs_of(run, job, resolve(run.settings, globals.seed));
  job.inputs = files_read(run, job.wall);
  job.explain = run.report.explain;
  job.summary = run.summary;
  job.restarts = restarts;
  if (!globals.hang_timeout.empty()) job.stall_limit = globals.hang_limit();
  check_together(run, job);
  return job;
}

ExitCode run_wall(WallJob job, Globals globals) {
  globals.force |= job.resume;
  job.display_options.overwrite |= globals.force;
  const EmptyFolders tidy(folder_of(job));
  job.open_ended() ? watch_interrupts() : watch_requests();
  std::optional<FolderLock> lock;
  const auto claim_outputs = [&] {
    check_outputs(job, globals);
    claim_folder(job, lock);
  };
  if (!inside_mpi_job()) {
    claim_outputs();
    if (!job.settings.finishes) note_what_is_left_out(resolve(job.settings, job.seed));
  }
  const auto body = [&](Communicator& comm) {
    const EmptyFolders tidy_in_job(folder_of(job));  // a rank that fails leaves run_ranks only to end the job
    // Where the display was chosen by what there is, hosts may differ: all ranks take rank 0's.
    WallJob agreed = job;
    if (!agreed.link) agreed.display = &find_display(broadcast_text(comm, std::string(job.display->name)));
    if (inside_mpi_job()) check_on_root(comm, claim_outputs);
    Session session(comm, globals.session(), [&] { return job.load(job.scene, job.settings); });
    return drive(agreed, globals, session);
  };
  return run_supervised(globals, job.restarts, job.open_ended() ? Interrupts::Stop : Interrupts::End, folder_of(job),
                        body);
}

namespace {

class WallRunCommand final : public Command {
 public:
  [[nodiscard]] bool collective() const override { return true; }
  [[nodiscard]] std::string_view name() const override { return "run"; }
  [[nodiscard]] std::string_view summary() const override { return "draw a scene on a wall"; }

  void declare(const OptionSet& options) override {
    declare_wall(options, run_.wall);
    declare_overrides(options, run_.overrides);
    options.option("scene", run_.scene, "a .gltf or .glb file, or gen:NAME?key=value").required();
    run_.display.declare(options);
    options.option("--scale", run_.scale, "of the screens' pixels, e.g. 0.25").range(1e-6, 1e6).show_default();
    const Option frames =
        options.option("--frames", run_.frames, "how many frames (default: 1; window and web: until they are closed)")
            .range(1, 1'000'000);
    options.flag("--until-stopped", run_.until_stopped, "go on until wall stop, Ctrl-C or SIGTERM").excludes(frames);
    options.flag("--resume", run_.resume, "go on after the frames that the manifest in -o DIR has, if it is there");
    options.option("--path", run_.path, "where the camera goes in these frames, see docs/commands.md").type("FILE");
    declare_target_ms(options, run_.target_ms, "what a frame may take; what is given up for it is in the manifest");
    options.option("--target-error", run_.target_error, "estimated relMSE at which a frame has enough samples");
    options
        .option("--restarts", run_.restarts,
                "how often an hour ranks that are lost are started again; 0: a lone one draws in this process")
        .range(0, 1000)
        .show_default();
    run_.link.declare(options, run_.settings);
    declare_settings(options, run_.settings);
    run_.report.declare(options);
    options.option("--raw", run_.raw, "keys of the last frame: FILE, or FILE-SCREEN of each of several screens")
        .type("FILE");
  }

  [[nodiscard]] bool opens_windows() const override { return true; }
  [[nodiscard]] ExitCode run(const Globals& globals) override {
    return run_wall(make_wall_job(run_, globals), globals);
  }

 private:
  WallRun run_;
};

}  // namespace

/// `hpr wall run WALL SCENE`.
std::unique_ptr<Command> make_wall_run_command() {
  return std::make_unique<WallRunCommand>();
}

void declare_wall(const OptionSet& options, std::string& wall) {
  options.option("wall", wall, "a wall file, or CxR, or CxR@WxH").required().type("WALL");
}

void declare_overrides(const OptionSet& options, std::vector<std::string>& overrides) {
  options.option("--set", overrides, "put a value over one of the wall file's, e.g. stereo.mode=anaglyph")
      .type("PATH=VALUE")
      .repeats();
}

void declare_target_ms(const OptionSet& options, std::optional<double>& target_ms, const std::string& text) {
  options.option("--target-ms", target_ms, text)
      .range(1e-3, 1e9)
      .units({{"us", 1e-3}, {"ms", 1.0}, {"s", 1e3}, {"min", 6e4}})
      .type("MS");
}

}  // namespace hpr
