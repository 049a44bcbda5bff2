#include "app/wall_run.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <thread>

#include "app/camera_path.h"
#include "app/launcher.h"
#include "app/output.h"
#include "app/progress.h"
#include "app/run_journal.h"
#include "app/signals.h"
#include "app/wall_driver.h"
#include "cluster/collectives.h"
#include "cluster/scene_distribution.h"
#include "core/file.h"
#include "core/log.h"
#include "core/names.h"
#include "image/image_io.h"
#include "walls/assemble.h"
#include "walls/geometry.h"
#include "walls/link/sender.h"
#include "walls/manifest.h"
#include "walls/wall_file.h"

namespace hpr {
namespace {

/// The assembled wall is a picture to look at, not the frame: larger walls are scaled down.
constexpr int kLargestPicture = 8192;

/// How well the target time was kept.
void report_budget(const RunManifest& manifest) {
  std::vector<double> ms;
  std::map<std::string, std::size_t> given_up;
  for (const FrameRecord& frame : manifest.frames) {
    ms.push_back(frame.ms);
    for (const std::string& what : frame.budget->given_up) ++given_up[what];
  }
  std::ranges::sort(ms);
  std::vector<std::string> words;
  for (const auto& [what, frames] : given_up) words.push_back(fmt::format("{} in {}", what, frames));
  log::info("{} frames: half took up to {:.1f} ms, 95 % up to {:.1f} ms, target {:.1f} ms; given up: {}", ms.size(),
            ms[(ms.size() - 1) / 2], ms[(ms.size() - 1) * 95 / 100], manifest.frames.back().budget->target_ms,
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
    if (run.writes_files()) {
      write_file_atomically(std::filesystem::path(run.display.output) / "wall.png", picture);
      write_file_atomically(std::filesystem::path(run.display.output) / "manifest.json", to_json(driver.manifest()));
    }
    if (!run.picture.empty()) write_file_atomically(run.picture, picture);
  }
  if (run.display.remote() && !run.display.output.empty()) {
    write_file_atomically(std::filesystem::path(run.display.output) / "manifest.json", to_json(driver.manifest()));
  }
  if (!run.options.stats.empty()) write_stats(run.options.stats, stats);
}

/// Collective. Follows the viewers, and does what others say, until there is a frame to draw; false when they ended the
/// run.
bool wait_for_work(const WallRun& run, WallDriver& driver) {
  constexpr std::chrono::milliseconds kBetweenLooks{10};
  while (true) {
    if (!driver.follow_viewers() || !driver.obey()) return false;
    if (!run.open_ended() || !driver.settled()) return true;
    std::this_thread::sleep_for(kBetweenLooks);
  }
}

ExitCode drive(const WallRun& run, const Wall& wall, const FrameSettings& settings, const Globals& globals,
               Session& session) {
  const bool speaks = session.comm().rank() == 0;
  const auto hashes = all_gather_value(session.comm(), wall.hash);
  for (std::size_t rank = 0; rank < hashes.size(); ++rank) {
    if (hashes[rank] != hashes[0]) {
      throw Error(ExitCode::BadInput, fmt::format("rank {} read another '{}' than rank 0", rank, run.wall),
                  "give every host the same wall file");
    }
  }
  WallDriver driver(run, wall, settings, globals, session);
  if (run.options.explain && speaks) {
    for (const std::string& line : driver.plan().explained) fmt::print("{}\n", line);
  }
  prepare(session, driver.plan());
  {
    const std::string mode = speaks ? globals.progress : "none";
    const Sampling sampling = sampling_of(run);
    const int frames = run.open_ended() ? 0 : run.frames.value_or(1);
    Progress progress(sampling.sums() ? "none" : mode, "frame", static_cast<std::size_t>(frames));
    for (int frame = static_cast<int>(driver.first_frame()); frame < frames || run.open_ended(); ++frame) {
      Progress samples(sampling.sums() ? mode : "none", fmt::format("frame {}: sample", frame + 1),
                       sampling.goal.samples.value_or(0));
      driver.draw(static_cast<std::uint64_t>(frame), samples);
      progress.step(fmt::format("{:.1f} ms", driver.last_cost().ms));
      const bool last = !run.open_ended() && frame + 1 >= frames;
      if (!last && !wait_for_work(run, driver)) break;
    }
  }
  const bool seen = driver.finish();
  RunStats stats = gather_stats(session, driver.plan(), driver.times(), driver.last_cost());
  stats.relmse = driver.relmse();
  stats.budget = driver.manifest().frames.back().budget;
  if (speaks && stats.budget) report_budget(driver.manifest());
  std::vector<Image<Rgba8>> pictures;
  if (run.writes_files() || !run.picture.empty()) pictures = driver.collect_pictures();
  agree_on_failure(session.comm(), [&] {
    if (speaks) write_results(run, wall, driver, stats, pictures);
  });
  if (!seen) return ExitCode::Lost;
  if (!speaks) return verdict(stats, run.options.strict);
  if (run.summary) print_summary(stats, wall, session.scene());
  if (!run.picture.empty()) {
    fmt::print("{}\n", run.picture);
  } else if (run.writes_files()) {
    fmt::print("{}\n", (std::filesystem::path(run.display.output) / "wall.png").string());
  } else if (run.display.remote() && !run.display.output.empty()) {
    fmt::print("{}\n", (std::filesystem::path(run.display.output) / "manifest.json").string());
  }
  return verdict(stats, run.options.strict);
}

void check_remote(const WallRun& run, const Wall& wall, const Globals& globals) {
  (void)run.remote.settings(wall);
  if (run.display.output.empty()) return;
  std::error_code error;
  std::filesystem::create_directories(run.display.output, error);
  check_writable(std::filesystem::path(run.display.output) / "manifest.json", globals.force);
}

void check_outputs(const WallRun& run, const Wall& wall, const Globals& globals) {
  const DisplayOptions display = run.display.options(globals);
  if (run.display.frames_on_stdout() && run.options.explain) {
    throw Error(ExitCode::Usage, "--explain writes to standard output, where the frames go",
                "leave it out, or send the frames elsewhere");
  }
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
  if (run.display.remote()) check_remote(run, wall, globals);
  if (run.writes_files()) {
    check_writable(std::filesystem::path(run.display.output) / "wall.png", globals.force);
    check_writable(std::filesystem::path(run.display.output) / "manifest.json", globals.force);
  }
}

/// A wrong path is found before any scene is loaded.
void check_path(const WallRun& run) {
  if (!run.options.camera.empty() || !run.options.eye.empty()) {
    throw Error(ExitCode::Usage, "--path says where the camera is, as do --camera and --eye", "use one of them");
  }
  if (run.open_ended()) {
    throw Error(ExitCode::Usage, "--path needs to know how many frames it takes", "add --frames N");
  }
  (void)load_camera_path(run.path);
}

}  // namespace

ExitCode run_wall(const WallRun& run, const Globals& given) {
  Globals globals = given;
  // What stands there is what the job that was lost had written.
  if (const auto journal = RunJournal::of_supervisor()) globals.force |= !journal->read().restarts.empty();
  Wall wall = load_wall(run.wall, run.overrides);
  if (run.scale != 1.0) wall = scale_wall(std::move(wall), run.scale);
  const FrameSettings settings = run.options.settings(globals.seed);
  if (!settings.aovs.empty()) {
    throw Error(ExitCode::Usage, "a wall has no AOVs", "use --aov with render");
  }
  if (!run.path.empty()) check_path(run);
  for (const auto& target : {run.target_ms, run.target_error}) {
    if (target && !std::isfinite(*target)) {
      throw Error(ExitCode::Usage, "--target-ms and --target-error take finite numbers", "write e.g. --target-ms 33");
    }
  }
  (void)run.options.wire.colors();
  (void)run.options.sampling();  // malformed numbers are found before any work
  for (const WallScreen& screen : wall.screens) check_size(screen.pixels, globals);
  for (const WallMonitor& monitor : wall.monitors) check_size(monitor.pixels, globals);
  const std::string folder = run.writes_files() ? run.display.output : "";
  const EmptyFolders tidy(folder);
  if (run.open_ended()) watch_interrupts();
  if (!inside_mpi_job()) check_outputs(run, wall, globals);
  const auto body = [&](Communicator& comm) {
    const EmptyFolders tidy_in_job(folder);  // a rank that fails leaves run_ranks only to end the job
    if (inside_mpi_job()) check_on_root(comm, [&] { check_outputs(run, wall, globals); });
    Session session(comm, globals, [&] { return run.options.load(run.scene, globals); });
    return drive(run, wall, settings, globals, session);
  };
  return run_supervised(globals, run.restarts, run.open_ended() ? Interrupts::Stop : Interrupts::End, body);
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
    app.add_option("--path", run_.path, "where the camera goes in these frames, see docs/cli.md")->type_name("FILE");
    app.add_option("--target-ms", run_.target_ms, "what a frame may take; what is given up for it is in the manifest")
        ->check(CLI::Range(1e-3, 1e9));
    app.add_option("--target-error", run_.target_error, "estimated relMSE at which a frame has enough samples")
        ->check(CLI::Range(1e-12, 1e12));
    app.add_option("--restarts", run_.restarts, "how often a job of several ranks that is lost is started again")
        ->check(CLI::Range(0, 1000))
        ->capture_default_str();
    run_.remote.declare(app);
    run_.options.declare(app);
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override { return run_wall(run_, globals); }

 private:
  WallRun run_;
};

}  // namespace

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
