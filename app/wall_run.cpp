#include "app/wall_run.h"

#include <fmt/format.h>
#include <hpr/version.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <optional>

#include "app/frame_sampler.h"
#include "app/launcher.h"
#include "app/output.h"
#include "app/progress.h"
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

std::vector<std::string> hosts_of(Communicator& comm, const std::string& mine) {
  std::vector<std::string> hosts;
  for (const auto& name : all_gather(comm, std::as_bytes(std::span(mine)))) {
    hosts.emplace_back(reinterpret_cast<const char*>(name.data()), name.size());
  }
  return hosts;
}

/// Drives one wall: what stays the same from frame to frame.
class WallDriver {
 public:
  WallDriver(const WallRun& run, const Wall& wall, const FrameSettings& settings, const Globals& globals,
             Session& session)
      : run_(run),
        wall_(wall),
        session_(session),
        screens_(wall_views(wall, run.options.choose_camera(session.scene()), session.scene().bounds)),
        blocks_(cut_blocks(screens_)),
        plan_(plan_frame(session, settings, blocks_.views)),
        shown_by_(owners_of(wall, hosts_of(session.comm(), session.host()))),
        sampling_(run.options.sampling()) {
    agree_on_failure(session_.comm(), [&] {
      if (shows_any()) display_ = make_display(run.display, wall, {.folder = run.folder, .overwrite = globals.force});
    });
    manifest_.scene_hash = content_hash(session.scene());
    manifest_.wall_hash = wall.hash;
    manifest_.seed = globals.seed;
    manifest_.versions = {
        {"hpr", std::string(kVersion)}, {"commit", std::string(kCommit)}, {"gl", session.gl().description()}};
  }

  [[nodiscard]] const FramePlan& plan() const { return plan_; }
  [[nodiscard]] const RunManifest& manifest() const { return manifest_; }
  [[nodiscard]] const FrameTimes& times() const { return times_; }
  [[nodiscard]] const FrameCost& last_cost() const { return last_cost_; }
  [[nodiscard]] std::optional<double> relmse() const { return relmse_; }

  /// Collective. Draws one frame and shows each screen on the rank it belongs to. `progress` is told of samples.
  void draw(std::uint64_t number, Progress& progress) {
    const Stopwatch watch;
    const std::size_t sent_before = session_.comm().bytes_sent();
    std::optional<FrameSampler> sampler;
    Frame whole;
    if (sampling_.sums()) {
      sampler.emplace(session_, plan_, sampling_, number, false);
      (void)sampler->draw(blocks_.views, {}, progress);  // it stops before its goal for a checkpoint only
      times_ = sampler->times();
      relmse_ = sampler->reached_so_far().relmse;
    } else {
      whole = make_frame(session_, plan_, blocks_.views, &times_, {{number, 0}, nullptr});
    }
    const Frame& frame = sampler ? sampler->frame() : whole;
    TileLayer<Rgba8> display = to_display(frame, session_.threads(), run_.options.exposure);
    session_.assembler().assemble(session_.comm(), display, frame.owned, block_owners(blocks_, shown_by_));
    pictures_.clear();
    for (std::size_t screen = 0; screen < shown_by_.size(); ++screen) {
      pictures_.push_back(shown_by_[screen] == session_.comm().rank() ? join_blocks(display, blocks_, screen)
                                                                      : Image<Rgba8>());
    }
    last_cost_ = {watch.ms(), session_.comm().bytes_sent() - sent_before};
    agree_on_failure(session_.comm(), [&] { show(number); });
    record(number);
  }

  /// Collective. All screens' pictures of the last frame, on rank 0.
  [[nodiscard]] std::vector<Image<Rgba8>> collect_pictures() {
    Communicator& comm = session_.comm();
    for (std::size_t screen = 0; screen < shown_by_.size(); ++screen) {
      const int from = shown_by_[screen];
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
  [[nodiscard]] bool shows_any() const {
    return std::ranges::find(shown_by_, session_.comm().rank()) != shown_by_.end();
  }

  void show(std::uint64_t number) {
    if (!display_) return;
    std::vector<ScreenPicture> mine;
    for (std::size_t screen = 0; screen < shown_by_.size(); ++screen) {
      if (shown_by_[screen] == session_.comm().rank()) mine.push_back({screen, pictures_[screen]});
    }
    display_->show({number, mine});
  }

  /// Every rank hashes what it showed; rank 0 writes it down.
  void record(std::uint64_t number) {
    std::vector<std::uint64_t> hashes(shown_by_.size(), 0);
    for (std::size_t screen = 0; screen < shown_by_.size(); ++screen) {
      if (shown_by_[screen] == session_.comm().rank()) {
        hashes[screen] = record_screen(wall_.screens[screen].id, pictures_[screen], ScreenState::Fresh).xxh64;
      }
    }
    const double slowest = std::ranges::max(all_gather_value(session_.comm(), last_cost_.ms));
    session_.comm().reduce_max(hashes, 0);  // all but the owner's are 0
    FrameRecord frame{number, slowest, strategy(), {}};
    for (std::size_t screen = 0; screen < hashes.size(); ++screen) {
      frame.screens.push_back(
          {wall_.screens[screen].id, wall_.screens[screen].pixels, hashes[screen], ScreenState::Fresh});
    }
    manifest_.frames.push_back(std::move(frame));
  }

  [[nodiscard]] std::string strategy() const {
    if (plan_.mine.group.size() == 1) return std::string(name_of(plan_.distribution));
    return std::string(session_.compositor(plan_.strategy, plan_.mine.group).chosen());
  }

  const WallRun& run_;
  const Wall& wall_;
  Session& session_;
  std::vector<View> screens_;
  Blocks blocks_;
  FramePlan plan_;
  std::vector<int> shown_by_;
  std::unique_ptr<Display> display_;
  std::vector<Image<Rgba8>> pictures_;  ///< per screen; empty where another rank shows it
  RunManifest manifest_;
  Sampling sampling_;
  FrameTimes times_;
  std::optional<double> relmse_;
  FrameCost last_cost_;
};

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
    const Sampling sampling = run.options.sampling();
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

}  // namespace

ExitCode run_wall(const WallRun& run, const Globals& globals) {
  Wall wall = load_wall(run.wall);
  if (run.scale != 1.0) wall = scale_wall(std::move(wall), run.scale);
  const FrameSettings settings = run.options.settings(globals.seed);
  if (!settings.aovs.empty()) {
    throw Error(ExitCode::Usage, "a wall has no AOVs", "use --aov with render");
  }
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
