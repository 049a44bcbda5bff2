#include "app/wall_run.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>

#include "app/camera_path.h"
#include "app/launcher.h"
#include "app/output.h"
#include "app/progress.h"
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
  if (run.display == "file" || !run.picture.empty()) {
    const std::vector<std::byte> picture = encode_png(draw_wall(wall, wall_picture(wall, kLargestPicture), pictures));
    if (run.display == "file") {
      write_file_atomically(std::filesystem::path(run.folder) / "wall.png", picture);
      write_file_atomically(std::filesystem::path(run.folder) / "manifest.json", to_json(driver.manifest()));
    }
    if (!run.picture.empty()) write_file_atomically(run.picture, picture);
  }
  if (run.display == kRemoteDisplay && !run.folder.empty()) {
    write_file_atomically(std::filesystem::path(run.folder) / "manifest.json", to_json(driver.manifest()));
  }
  if (!run.options.stats.empty()) write_stats(run.options.stats, stats);
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
    Progress progress(sampling.sums() ? "none" : mode, "frame", static_cast<std::size_t>(run.frames));
    for (int frame = 0; frame < run.frames; ++frame) {
      Progress samples(sampling.sums() ? mode : "none", fmt::format("frame {}/{}: sample", frame + 1, run.frames),
                       sampling.goal.samples.value_or(0));
      driver.draw(static_cast<std::uint64_t>(frame), samples);
      progress.step(fmt::format("{:.1f} ms", driver.last_cost().ms));
    }
  }
  const bool seen = driver.finish();
  RunStats stats = gather_stats(session, driver.plan(), driver.times(), driver.last_cost());
  stats.relmse = driver.relmse();
  stats.budget = driver.manifest().frames.back().budget;
  if (speaks && stats.budget) report_budget(driver.manifest());
  std::vector<Image<Rgba8>> pictures;
  if (run.display == "file" || !run.picture.empty()) pictures = driver.collect_pictures();
  agree_on_failure(session.comm(), [&] {
    if (speaks) write_results(run, wall, driver, stats, pictures);
  });
  if (!seen) return ExitCode::Lost;
  if (!speaks) return verdict(stats, run.options.strict);
  if (run.summary) print_summary(stats, wall, session.scene());
  if (!run.picture.empty()) {
    fmt::print("{}\n", run.picture);
  } else if (run.display == "file") {
    fmt::print("{}\n", (std::filesystem::path(run.folder) / "wall.png").string());
  } else if (run.display == kRemoteDisplay && !run.folder.empty()) {
    fmt::print("{}\n", (std::filesystem::path(run.folder) / "manifest.json").string());
  }
  return verdict(stats, run.options.strict);
}

void check_remote(const WallRun& run, const Wall& wall, const Globals& globals) {
  (void)run.remote.settings(wall);
  if (run.folder.empty()) return;
  std::error_code error;
  std::filesystem::create_directories(run.folder, error);
  check_writable(std::filesystem::path(run.folder) / "manifest.json", globals.force);
}

void check_display(const WallRun& run, const Wall& wall, const Globals& globals) {
  std::vector<std::string> names = all_displays();
  names.emplace_back(kRemoteDisplay);
  if (std::ranges::find(names, run.display) == names.end()) {
    throw Error(ExitCode::Usage, fmt::format("unknown display '{}'", printable(run.display)),
                unknown_name_hint(run.display, names));
  }
  (void)make_display(run.display, wall, {.folder = run.folder, .overwrite = globals.force});
}

void check_outputs(const WallRun& run, const Wall& wall, const Globals& globals) {
  if (run.display == "file" && run.folder.empty()) {
    throw Error(ExitCode::Usage, "the file display needs a folder", "name one with -o DIR, or use --display none");
  }
  if (!run.picture.empty()) {
    if (!run.picture.ends_with(".png")) {
      throw Error(ExitCode::Usage, fmt::format("cannot write '{}': the assembled wall is a PNG", run.picture),
                  "name a .png file");
    }
    check_writable(run.picture, globals.force);
  }
  if (!run.options.stats.empty()) check_writable(run.options.stats, globals.force);
  // Made to be checked, and last, as it may make its folder: an unknown display or a folder that may not be written is
  // found before any rank starts.
  if (run.display == kRemoteDisplay) {
    check_remote(run, wall, globals);
  } else {
    check_display(run, wall, globals);
  }
  if (run.display == "file") {
    check_writable(std::filesystem::path(run.folder) / "wall.png", globals.force);
    check_writable(std::filesystem::path(run.folder) / "manifest.json", globals.force);
  }
}

/// A wrong path is found before any scene is loaded.
void check_path(const WallRun& run) {
  if (!run.options.camera.empty() || !run.options.eye.empty()) {
    throw Error(ExitCode::Usage, "--path says where the camera is, as do --camera and --eye", "use one of them");
  }
  (void)load_camera_path(run.path);
}

}  // namespace

ExitCode run_wall(const WallRun& run, const Globals& globals) {
  Wall wall = load_wall(run.wall);
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
  const EmptyFolders tidy(run.folder);
  if (!inside_mpi_job()) check_outputs(run, wall, globals);
  return run_ranks(globals, [&](Communicator& comm) {
    const EmptyFolders tidy_in_job(run.folder);  // a rank that fails leaves run_ranks only to end the job
    if (inside_mpi_job()) check_on_root(comm, [&] { check_outputs(run, wall, globals); });
    Session session(comm, globals, [&] { return run.options.load(run.scene, globals); });
    return drive(run, wall, settings, globals, session);
  });
}

namespace {

class WallRunCommand final : public Command {
 public:
  [[nodiscard]] bool collective() const override { return true; }
  [[nodiscard]] std::string_view name() const override { return "run"; }
  [[nodiscard]] std::string_view summary() const override { return "draw a scene on a wall"; }

  void declare(CLI::App& app) override {
    app.add_option("wall", run_.wall, "a wall file, or CxR, or CxR@WxH")->required();
    app.add_option("scene", run_.scene, "a .gltf or .glb file, or gen:NAME?key=value")->required();
    app.add_option("--display", run_.display, "file, none, or remote: display processes, see hpr display")
        ->capture_default_str();
    app.add_option("-o,--output", run_.folder, "folder for the pictures of the file display, and the manifest")
        ->type_name("DIR");
    app.add_option("--scale", run_.scale, "of the screens' pixels, e.g. 0.25")
        ->check(CLI::Range(1e-6, 1e6))
        ->capture_default_str();
    app.add_option("--frames", run_.frames, "how many frames")->check(CLI::Range(1, 1'000'000))->capture_default_str();
    app.add_option("--path", run_.path, "where the camera goes in these frames, see docs/cli.md")->type_name("FILE");
    app.add_option("--target-ms", run_.target_ms, "what a frame may take; what is given up for it is in the manifest")
        ->check(CLI::Range(1e-3, 1e9));
    app.add_option("--target-error", run_.target_error, "estimated relMSE at which a frame has enough samples")
        ->check(CLI::Range(1e-12, 1e12));
    run_.remote.declare(app);
    run_.options.declare(app);
  }

  [[nodiscard]] ExitCode run(const Globals& globals) override { return run_wall(run_, globals); }

 private:
  WallRun run_;
};

}  // namespace

std::unique_ptr<Command> make_wall_run_command() {
  return std::make_unique<WallRunCommand>();
}

}  // namespace hpr
