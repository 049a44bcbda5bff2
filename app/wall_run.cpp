#include "app/wall_run.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <hpr/version.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <optional>

#include "app/camera_path.h"
#include "app/frame_maker.h"
#include "app/launcher.h"
#include "app/output.h"
#include "app/progress.h"
#include "app/screens.h"
#include "cluster/collectives.h"
#include "cluster/scene_distribution.h"
#include "compositing/assembly.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/log.h"
#include "core/names.h"
#include "core/stopwatch.h"
#include "image/image_io.h"
#include "walls/assemble.h"
#include "walls/geometry.h"
#include "walls/manifest.h"
#include "walls/wall_file.h"

namespace hpr {
namespace {

/// The assembled wall is a picture to look at, not the frame: larger walls are scaled down.
constexpr int kLargestPicture = 8192;

/// A rank that writes pictures first loads the image module, which costs as much as encoding this many pixels.
constexpr std::size_t kPixelsWorthAWriter = 4'000'000;

/// Per screen the rank that shows it: the one the wall file names, else one on the screen's host, else any: no more
/// ranks than the pixels keep busy, each with neighbouring screens.
std::vector<int> owners_of(const Wall& wall, const std::vector<std::string>& hosts) {
  const int ranks = static_cast<int>(hosts.size());
  std::size_t pixels = 0;
  for (const WallScreen& screen : wall.screens) pixels += screen.pixels.area();
  const std::size_t writers = std::clamp<std::size_t>(pixels / kPixelsWorthAWriter, 1, hosts.size());

  std::vector<int> owners;
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    const WallScreen& screen = wall.screens[i];
    const auto node = std::ranges::find(wall.nodes, screen.node, &WallNode::id);
    std::vector<int> on_its_host;
    for (int rank = 0; rank < ranks; ++rank) {
      if (node != wall.nodes.end() && node->host == hosts[static_cast<std::size_t>(rank)]) on_its_host.push_back(rank);
    }
    if (screen.rank >= 0 && screen.rank < ranks) {
      owners.push_back(screen.rank);
    } else if (!on_its_host.empty()) {
      owners.push_back(on_its_host[i % on_its_host.size()]);
    } else {
      owners.push_back(static_cast<int>(i * writers / wall.screens.size()));
    }
    const bool any_host = node == wall.nodes.end() || node->host == "localhost" || node->host == "*";
    if (screen.rank < 0 && on_its_host.empty() && !any_host) {
      log::warning("no rank runs on host '{}' of screen '{}': rank {} shows it", node->host, screen.id, owners.back());
    }
    if (screen.rank >= ranks) {
      log::warning("screen '{}' belongs to rank {}, but there are only {}: rank {} shows it", screen.id, screen.rank,
                   ranks, owners.back());
    }
  }
  return owners;
}

std::vector<Size> sizes_of(const Wall& wall) {
  std::vector<Size> sizes;
  for (const WallScreen& screen : wall.screens) sizes.push_back(screen.pixels);
  return sizes;
}

std::vector<std::string> hosts_of(Communicator& comm, const std::string& mine) {
  std::vector<std::string> hosts;
  for (const auto& name : all_gather(comm, std::as_bytes(std::span(mine)))) {
    hosts.emplace_back(reinterpret_cast<const char*>(name.data()), name.size());
  }
  return hosts;
}

/// As the options say, until the target error where there is one.
Sampling sampling_of(const WallRun& run) {
  Sampling sampling = run.options.sampling();
  if (!run.target_error) return sampling;
  sampling.goal.relmse = run.target_error;
  if (!run.options.spp) sampling.goal.samples.reset();
  return sampling;
}

/// Drives one wall: what stays the same from frame to frame.
class WallDriver {
 public:
  WallDriver(const WallRun& run, const Wall& wall, const FrameSettings& settings, const Globals& globals,
             Session& session)
      : run_(run),
        wall_(wall),
        session_(session),
        path_(run.path.empty() ? std::optional<CameraPath>() : load_camera_path(run.path)),
        frames_(session, settings, sampling_of(run), screens_in(0), run.target_ms),
        showing_{sizes_of(wall), owners_of(wall, hosts_of(session.comm(), session.host())), run.options.exposure} {
    agree_on_failure(session_.comm(), [&] {
      if (shows_any()) display_ = make_display(run.display, wall, {.folder = run.folder, .overwrite = globals.force});
    });
    manifest_.scene_hash = content_hash(session.scene());
    manifest_.wall_hash = wall.hash;
    manifest_.seed = globals.seed;
    manifest_.versions = {
        {"hpr", std::string(kVersion)}, {"commit", std::string(kCommit)}, {"gl", session.gl().description()}};
  }

  [[nodiscard]] const FramePlan& plan() const { return frames_.plan(); }
  [[nodiscard]] const RunManifest& manifest() const { return manifest_; }
  [[nodiscard]] const FrameTimes& times() const { return frames_.times(); }
  [[nodiscard]] const FrameCost& last_cost() const { return last_cost_; }
  [[nodiscard]] std::optional<double> relmse() const { return frames_.relmse(); }

  /// Collective. Draws one frame and shows each screen on the rank it belongs to. `progress` is told of samples.
  void draw(std::uint64_t number, Progress& progress) {
    const Stopwatch watch;
    const std::size_t sent_before = session_.comm().bytes_sent();
    Frame& frame = frames_.make(screens_in(number), number, progress);
    pictures_ = bring_to_screens(session_, frame, frames_.blocks(), showing_);
    last_cost_ = {watch.ms(), session_.comm().bytes_sent() - sent_before};
    agree_on_failure(session_.comm(), [&] { show(number); });
    record(number);
  }

  /// Collective. All screens' pictures of the last frame, on rank 0.
  [[nodiscard]] std::vector<Image<Rgba8>> collect_pictures() {
    Communicator& comm = session_.comm();
    for (std::size_t screen = 0; screen < showing_.shown_by.size(); ++screen) {
      const int from = showing_.shown_by[screen];
      if (from == 0) continue;
      if (comm.rank() == from) comm.send(std::as_bytes(pictures_[screen].pixels()), 0);
      if (comm.rank() == 0) {
        pictures_[screen] = Image<Rgba8>(wall_.screens[screen].pixels);
        comm.receive(std::as_writable_bytes(pictures_[screen].pixels()), from);
      }
    }
    return std::move(pictures_);
  }

 private:
  [[nodiscard]] std::vector<View> screens_in(std::uint64_t frame) const {
    const Camera camera = path_ ? camera_of(path_->at_frame(frame, static_cast<std::size_t>(run_.frames)))
                                : run_.options.choose_camera(session_.scene());
    return wall_views(wall_, camera, session_.scene().bounds);
  }

  [[nodiscard]] bool shows_any() const {
    return std::ranges::find(showing_.shown_by, session_.comm().rank()) != showing_.shown_by.end();
  }

  void show(std::uint64_t number) {
    if (!display_) return;
    std::vector<ScreenPicture> mine;
    for (std::size_t screen = 0; screen < showing_.shown_by.size(); ++screen) {
      if (showing_.shown_by[screen] == session_.comm().rank()) mine.push_back({screen, pictures_[screen]});
    }
    display_->show({number, mine});
  }

  /// Every rank hashes what it showed; rank 0 writes it down.
  void record(std::uint64_t number) {
    std::vector<std::uint64_t> hashes(showing_.shown_by.size(), 0);
    for (std::size_t screen = 0; screen < showing_.shown_by.size(); ++screen) {
      if (showing_.shown_by[screen] == session_.comm().rank()) {
        hashes[screen] = record_screen(wall_.screens[screen].id, pictures_[screen], ScreenState::Fresh).xxh64;
      }
    }
    const double slowest = std::ranges::max(all_gather_value(session_.comm(), last_cost_.ms));
    session_.comm().reduce_max(hashes, 0);  // all but the owner's are 0
    frames_.took(slowest);
    FrameRecord frame{number, slowest, strategy(), {}, frames_.report()};
    for (std::size_t screen = 0; screen < hashes.size(); ++screen) {
      frame.screens.push_back(
          {wall_.screens[screen].id, wall_.screens[screen].pixels, hashes[screen], ScreenState::Fresh});
    }
    manifest_.frames.push_back(std::move(frame));
  }

  [[nodiscard]] std::string strategy() const {
    const FramePlan& made = plan();
    if (made.mine.group.size() == 1) return std::string(name_of(made.distribution));
    return std::string(session_.compositor(made.strategy, made.mine.group).chosen());
  }

  const WallRun& run_;
  const Wall& wall_;
  Session& session_;
  std::optional<CameraPath> path_;
  FrameMaker frames_;
  Showing showing_;
  std::unique_ptr<Display> display_;
  std::vector<Image<Rgba8>> pictures_;  ///< per screen; empty where another rank shows it
  RunManifest manifest_;
  FrameCost last_cost_;
};

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
  RunStats stats = gather_stats(session, driver.plan(), driver.times(), driver.last_cost());
  stats.relmse = driver.relmse();
  stats.budget = driver.manifest().frames.back().budget;
  if (speaks && stats.budget) report_budget(driver.manifest());
  std::vector<Image<Rgba8>> pictures;
  if (run.display == "file" || !run.picture.empty()) pictures = driver.collect_pictures();
  agree_on_failure(session.comm(), [&] {
    if (speaks) write_results(run, wall, driver, stats, pictures);
  });
  if (!speaks) return verdict(stats, run.options.strict);
  if (run.summary) print_summary(stats, wall, session.scene());
  if (!run.picture.empty()) {
    fmt::print("{}\n", run.picture);
  } else if (run.display == "file") {
    fmt::print("{}\n", (std::filesystem::path(run.folder) / "wall.png").string());
  }
  return verdict(stats, run.options.strict);
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
  (void)make_display(run.display, wall, {.folder = run.folder, .overwrite = globals.force});
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
    app.add_option("--display", run_.display, "file or none")->capture_default_str();
    app.add_option("-o,--output", run_.folder, "folder for the pictures of the file display")->type_name("DIR");
    app.add_option("--scale", run_.scale, "of the screens' pixels, e.g. 0.25")
        ->check(CLI::Range(1e-6, 1e6))
        ->capture_default_str();
    app.add_option("--frames", run_.frames, "how many frames")->check(CLI::Range(1, 1'000'000))->capture_default_str();
    app.add_option("--path", run_.path, "where the camera goes in these frames, see docs/cli.md")->type_name("FILE");
    app.add_option("--target-ms", run_.target_ms, "what a frame may take; what is given up for it is in the manifest")
        ->check(CLI::Range(1e-3, 1e9));
    app.add_option("--target-error", run_.target_error, "estimated relMSE at which a frame has enough samples")
        ->check(CLI::Range(1e-12, 1e12));
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
