#include "app/commands/wall_run.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <thread>

#include "app/launch/launcher.h"
#include "app/launch/supervisor.h"
#include "app/output_files.h"
#include "app/stats_file.h"
#include "cluster/transport/agreement.h"
#include "cluster/transport/collectives.h"
#include "cluster/transport/texts.h"
#include "core/file.h"
#include "core/job_environment.h"
#include "core/log.h"
#include "core/names.h"
#include "core/progress.h"
#include "core/stopwatch.h"
#include "engine/camera_path.h"
#include "engine/output.h"
#include "engine/signals.h"
#include "engine/wall/wall_driver.h"
#include "engine/wall/wall_layers.h"
#include "engine/wall/wall_status.h"
#include "image/image_io.h"
#include "walls/config/wall_file.h"
#include "walls/displays/file_display.h"
#include "walls/drawing/assemble.h"
#include "walls/geometry/geometry.h"
#include "walls/link/sender.h"
#include "walls/manifest/manifest.h"
#include "walls/manifest/run_journal.h"

namespace hpr {
namespace {

/// The file of the assembled wall; empty: none.
std::filesystem::path assembled_file(const WallRun& run) {
  return run.writes_files() ? std::filesystem::path(run.display.output) / "wall.png" : std::filesystem::path();
}

/// How well the target time was kept.
void report_budget(const RunManifest& manifest) {
  std::vector<double> ms;
  std::map<std::string, std::size_t> given_up;
  for (const FrameRecord& frame : manifest.frames) {
    if (frame.budget->resting) continue;
    ms.push_back(frame.ms);
    for (const std::string& what : frame.budget->given_up) ++given_up[what];
  }
  if (ms.empty()) return;
  std::ranges::sort(ms);
  const auto within = [&](std::size_t percent) { return ms[(percent * ms.size() + 99) / 100 - 1]; };  // nearest rank
  std::vector<std::string> words;
  words.reserve(given_up.size());
  for (const auto& [what, frames] : given_up) words.push_back(fmt::format("{} in {}", what, frames));
  log::info("{} frames: half took up to {:.1f} ms, 95 % up to {:.1f} ms, target {:.1f} ms; given up: {}", ms.size(),
            within(50), within(95), manifest.frames.back().budget->target_ms,
            words.empty() ? "nothing" : fmt::format("{}", fmt::join(words, ", ")));
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
    if (!pass.runs) fmt::print("{:<10} off: {}\n", pass.name, pass.why);
  }
  fmt::print("frame      {:7.1f} ms, {} shadow and {} reflection rays\n", stats.ms, stats.rays.shadow,
             stats.rays.reflection);
}

/// Rank 0's files of a finished run: the assembled wall and what was done.
void write_results(const WallRun& run, const Wall& wall, const WallDriver& driver, const RunStats& stats,
                   std::span<const Image<Rgba8>> pictures) {
  if (run.writes_files() || !run.picture.empty()) {
    const std::vector<std::byte> picture = encode_png(draw_wall(wall, wall_picture(wall, kLargestPicture), pictures));
    if (run.writes_files()) write_file_atomically(assembled_file(run), picture);
    if (!run.picture.empty()) write_file_atomically(run.picture, picture);
  }
  if (!run.manifest().empty()) write_file_atomically(run.manifest(), to_json(driver.manifest()));
  if (!run.options.stats.empty()) write_stats(run.options.stats, stats);
}

/// Collective. Follows the viewers, and does what others say, until there is a frame to draw; false when they ended the
/// run.
bool wait_for_work(const WallRun& run, WallDriver& driver) {
  constexpr std::chrono::milliseconds kBetweenLooks{10};
  // Displays outside the job take a run that sends nothing for one that is gone. Counted, so that all ranks agree.
  constexpr int kLooksBeforeSignOfLife = 30;
  for (int look = 0;; ++look) {
    if (!driver.follow_viewers() || !driver.obey()) return false;
    if (!run.open_ended() || !driver.settled()) return true;
    if (run.display.remote() && look == kLooksBeforeSignOfLife) return true;
    std::this_thread::sleep_for(kBetweenLooks);
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

/// Collective. Draws until the last of `frames`, where the run is not open-ended, or until somebody ends it; whether it
/// was ended before its last frame. `mode`: how progress is shown.
bool draw_frames(const WallRun& run, WallDriver& driver, int frames, const std::string& mode) {
  const Sampling sampling = sampling_of(run);
  // A terminal has room for one bar: that of the samples, where there are several.
  const bool tells_samples = sampling.sums() && (mode != "auto" || stderr_is_terminal());
  WallStatus status(tells_samples ? "none" : mode, driver.first_frame(), static_cast<std::size_t>(frames));
  for (int frame = static_cast<int>(driver.first_frame()); frame < frames || run.open_ended(); ++frame) {
    Progress samples(sampling.sums() ? mode : "none", fmt::format("frame {}: sample", frame + 1),
                     sampling.goal.samples.value_or(0));
    const Stopwatch watch;
    driver.draw(static_cast<std::uint64_t>(frame), samples);
    status.add(watch.ms(), driver.manifest().frames.back(), [&] { return driver.states(); });
    const bool last = !run.open_ended() && frame + 1 >= frames;
    if (!last && !wait_for_work(run, driver)) return !run.open_ended();
  }
  return false;
}

/// What a run says at its end: what was done, if asked, and where its result is. `stopped_of`: the frames it was to
/// draw, where it did not.
void print_end(const WallRun& run, const WallDriver& driver, std::optional<int> stopped_of, const RunStats& stats,
               const Wall& wall, const Scene& scene) {
  if (stopped_of)
    log::info("stopped after frame {} of {}{}", driver.manifest().frames.back().frame + 1, *stopped_of,
              run.manifest().empty() ? "" : "; --resume goes on");
  if (run.summary) print_summary(stats, wall, scene);
  if (!run.picture.empty()) {
    fmt::print("{}\n", run.picture);
  } else if (run.writes_files()) {
    fmt::print("{}\n", assembled_file(run).string());
  } else if (!run.manifest().empty()) {
    fmt::print("{}\n", run.manifest().string());
  }
}

ExitCode drive(const WallRun& run, const Wall& wall, const FrameSettings& settings, const Globals& globals,
               Session& session) {
  const bool speaks = session.comm().rank() == 0;
  check_same_wall(session.comm(), wall, run.wall);
  WallDriver driver(run, wall, settings, globals, session);
  if (run.options.explain && speaks) fmt::print("{}\n", fmt::join(driver.explained(), "\n"));
  prepare(session, driver.plan());
  const int frames = run.open_ended() ? 0 : run.frames.value_or(1);
  const bool ended_early =
      draw_frames(run, driver, frames, speaks && globals.verbosity >= 0 ? globals.progress : "none");
  if (ended_early) driver.note_stop(frames);
  const bool stopped = ended_early && driver.interrupted();
  const bool seen = driver.finish();
  RunStats stats = gather_stats(session, driver.plan(), driver.times(), driver.last_cost());
  stats.relmse = driver.relmse();
  stats.budget = driver.frames().report();
  if (speaks && stats.budget) report_budget(driver.manifest());
  write_layers(WallLayers(run, wall, settings), settings.aovs, driver, session);
  std::vector<Image<Rgba8>> pictures;
  if (run.writes_files() || !run.picture.empty()) pictures = driver.collect_pictures();
  agree_on_failure(session.comm(), [&] {
    if (speaks) write_results(run, wall, driver, stats, pictures);
  });
  if (!seen) return ExitCode::Lost;
  const ExitCode code = stopped && !run.manifest().empty() ? ExitCode::Stopped : verdict(stats, run.options.strict);
  if (speaks) {
    print_end(run, driver, stopped ? std::optional(frames) : std::nullopt, stats, wall, session.scene());
  }
  return code;
}

void check_remote(const WallRun& run, const Wall& wall, const Globals& globals) {
  (void)run.remote.settings(wall);
  if (run.display.output.empty()) return;
  std::error_code error;
  std::filesystem::create_directories(run.display.output, error);
  check_writable(run.manifest(), globals.force);
}

/// Beside the scene's.
std::vector<std::string> files_read(const WallRun& run, const Wall& wall) {
  std::vector<std::string> files{run.wall, run.path, run.options.environment};
  const std::filesystem::path folder = std::filesystem::path(run.wall).parent_path();
  for (const WallScreen& screen : wall.screens) {
    for (const WarpFile* const file : {&screen.warp.mesh, &screen.warp.blend, &screen.warp.black}) {
      if (!file->path.empty()) files.push_back((folder / file->path).string());
    }
  }
  for (const WallViewer& viewer : wall.viewers) files.push_back(viewer.tracker.file);
  return files;
}

void check_outputs(const WallRun& run, const Wall& wall, const FrameSettings& settings, const Globals& globals) {
  const DisplayOptions display = run.display.options(globals);
  if (run.display.frames_on_stdout() && run.options.explain) {
    throw Error(ExitCode::Usage, "--explain writes to standard output, where the frames go",
                "leave it out, or send the frames elsewhere");
  }
  std::vector<std::string> results{run.picture, run.options.stats, run.manifest().string(),
                                   assembled_file(run).string()};
  if (run.display.kind().stream && run.display.output != "-") results.push_back(run.display.output);
  if (run.writes_files()) {
    for (const auto& file : files_of_display(wall, run.display.output)) results.push_back(file.string());
  }
  const std::vector<std::string> layers = WallLayers(run, wall, settings).all();
  results.insert(results.end(), layers.begin(), layers.end());
  check_distinct(results, globals.trace);
  check_spared(run.scene, globals.scene_limits(), files_read(run, wall), results);
  if (!run.picture.empty()) {
    if (!run.picture.ends_with(".png")) {
      throw Error(ExitCode::Usage, fmt::format("cannot write '{}': the assembled wall is a PNG", run.picture),
                  "name a .png file");
    }
    check_writable(run.picture, globals.force);
  }
  if (!run.options.stats.empty()) check_writable(run.options.stats, globals.force);
  // Last, as it may make its folder: what cannot be shown is found before any rank starts.
  run.display.kind().check(wall, display);
  if (run.display.remote()) {
    check_remote(run, wall, globals);
  } else {
    run.remote.refuse();
  }
  for (const std::string& file : layers) check_writable(file, globals.force);
  if (run.writes_files()) {
    check_writable(assembled_file(run), globals.force);
    check_writable(run.manifest(), globals.force);
  }
}

/// Collective. Where the display was chosen by what there is, hosts may differ: all ranks take rank 0's.
WallRun with_display_of_root(const WallRun& run, Communicator& comm) {
  WallRun agreed = run;
  agreed.display.display = broadcast_text(comm, run.display.display);
  return agreed;
}

/// A wrong path is found before any scene is loaded.
void check_path(const WallRun& run) {
  if (!run.options.camera.empty() || !run.options.eye.empty()) {
    throw Error(ExitCode::Usage, "--path says where the camera is, as do --camera and --eye", "use one of them");
  }
  if (run.open_ended()) {
    throw Error(ExitCode::Usage, "--path needs to know how many frames it takes", "add --frames N");
  }
  check_directions(load_camera_path(run.path), static_cast<std::size_t>(run.frames.value_or(1)), run.path);
}

void check_resume(const WallRun& run) {
  if (run.resume && (run.open_ended() || run.manifest().empty())) {
    throw Error(ExitCode::Usage, "--resume needs to know how many frames it goes on to, and which run with",
                "use it with --frames N, --display file or remote, and -o DIR");
  }
}

/// What the options say beside the wall and the scene, before either is drawn. Throws Error.
void check_options(const WallRun& run) {
  if (!run.path.empty()) check_path(run);
  for (const auto& target : {run.target_ms, run.target_error}) {
    if (target && !std::isfinite(*target)) {
      throw Error(ExitCode::Usage, "--target-ms and --target-error take finite numbers", "write e.g. --target-ms 33");
    }
  }
  if (run.target_error && !(*run.target_error >= 1e-12 && *run.target_error <= 1e12)) {
    throw Error(ExitCode::Usage, fmt::format("--target-error {:g} is not from 1e-12 to 1e12", *run.target_error),
                "write e.g. --target-error 1e-3");
  }
  (void)run.options.wire.colors();
  (void)run.options.sampling();  // malformed numbers are found before any work
}

}  // namespace

ExitCode run_wall(const WallRun& run, const Globals& given) {
  Globals globals = given;
  // What stands there is what the job that was lost had written.
  if (const auto journal = RunJournal::of_supervisor()) globals.force |= !journal->read().restarts.empty();
  globals.force |= run.resume;
  check_resume(run);
  const bool starts_job = globals.ranks > 1 && !inside_mpi_job();  // whose rank 0 tells of the same findings
  Wall wall = load_wall(run.wall, run.overrides, !starts_job);
  if (run.scale != 1.0) wall = scale_wall(std::move(wall), run.scale);
  const FrameSettings settings = run.options.settings(globals.seed);
  check_options(run);
  for (const WallScreen& screen : wall.screens) check_size(screen.pixels, globals.picture_limits());
  for (const WallMonitor& monitor : wall.monitors) check_size(monitor.pixels, globals.picture_limits());
  const std::string folder = run.writes_files() ? run.display.output : "";
  const EmptyFolders tidy(folder);
  run.open_ended() ? watch_interrupts() : watch_requests();
  std::optional<FolderLock> lock;
  const auto claim_outputs = [&](const WallRun& chosen) {
    if (chosen.writes_files() && !launched_by_hpr()) {
      std::error_code error;
      std::filesystem::create_directories(chosen.display.output, error);
      if (!error) lock.emplace(chosen.display.output);  // else it is told of below
    }
    check_outputs(chosen, wall, settings, globals);
  };
  if (!inside_mpi_job()) claim_outputs(run);
  const auto body = [&](Communicator& comm) {
    const EmptyFolders tidy_in_job(folder);  // a rank that fails leaves run_ranks only to end the job
    const WallRun agreed = with_display_of_root(run, comm);
    if (inside_mpi_job()) check_on_root(comm, [&] { claim_outputs(agreed); });
    Session session(comm, globals.session(), [&] { return run.options.load(run.scene, globals); });
    return drive(agreed, wall, settings, globals, session);
  };
  const int restarts = run.display.kind().stream ? 0 : run.restarts;
  return run_supervised(globals, restarts, run.open_ended() ? Interrupts::Stop : Interrupts::End, body);
}

namespace {

class WallRunCommand final : public Command {
 public:
  [[nodiscard]] bool collective() const override { return true; }
  [[nodiscard]] std::string_view name() const override { return "run"; }
  [[nodiscard]] std::string_view summary() const override { return "draw a scene on a wall"; }

  void declare(CLI::App& app) override {
    app.add_option("wall", run_.wall, "a wall file, or CxR, or CxR@WxH")->required();
    declare_overrides(app, run_.overrides);
    app.add_option("scene", run_.scene, "a .gltf or .glb file, or gen:NAME?key=value")->required();
    run_.display.declare(app);
    app.add_option("--scale", run_.scale, "of the screens' pixels, e.g. 0.25")
        ->check(CLI::Range(1e-6, 1e6))
        ->capture_default_str();
    app.add_option("--frames", run_.frames, "how many frames (default: 1; window and web: until they are closed)")
        ->check(CLI::Range(1, 1'000'000));
    app.add_flag("--until-stopped", run_.until_stopped, "go on until wall stop, Ctrl-C or SIGTERM")
        ->excludes("--frames");
    app.add_flag("--resume", run_.resume, "go on after the frames that the manifest in -o DIR has, if it is there");
    app.add_option("--path", run_.path, "where the camera goes in these frames, see docs/cli.md")->type_name("FILE");
    declare_target_ms(app, run_.target_ms, "what a frame may take; what is given up for it is in the manifest");
    app.add_option("--target-error", run_.target_error, "estimated relMSE at which a frame has enough samples");
    app.add_option("--restarts", run_.restarts, "how often a job of several ranks that is lost is started again")
        ->check(CLI::Range(0, 1000))
        ->capture_default_str();
    run_.remote.declare(app);
    run_.options.declare(app);
    app.add_option("--raw", run_.raw, "keys of the last frame: FILE, or FILE-SCREEN of each of several screens")
        ->type_name("FILE");
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override { return run_wall(run_, globals); }

 private:
  WallRun run_;
};

}  // namespace

void declare_target_ms(CLI::App& app, std::optional<double>& target_ms, const std::string& text) {
  const std::map<std::string, double> units{{"us", 1e-3}, {"ms", 1.0}, {"s", 1e3}, {"min", 6e4}};
  app.add_option("--target-ms", target_ms, text)
      ->check(CLI::Range(1e-3, 1e9))
      ->transform(CLI::AsNumberWithUnit(units))
      ->type_name("MS");
}

void declare_overrides(CLI::App& app, std::vector<std::string>& overrides) {
  app.add_option("--set", overrides, "put a value over one of the wall file's, e.g. stereo.mode=anaglyph")
      ->type_name("PATH=VALUE")
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->allow_extra_args(false);
}

std::unique_ptr<Command> make_wall_run_command() {
  return std::make_unique<WallRunCommand>();
}

}  // namespace hpr
