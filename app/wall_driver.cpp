#include "app/wall_driver.h"

#include <hpr/version.h>

#include <algorithm>

#include "app/remote_wall.h"
#include "cluster/collectives.h"
#include "cluster/scene_distribution.h"
#include "core/hash.h"
#include "core/log.h"
#include "core/stopwatch.h"
#include "walls/geometry.h"
#include "walls/link/sender.h"

namespace hpr {
namespace {

/// A rank that writes pictures first loads the image module, which costs as much as encoding this many pixels.
constexpr std::size_t kPixelsWorthAWriter = 4'000'000;

/// Per screen the rank that shows it: the one the wall file names, else one on the screen's host, else any: no more
/// ranks than the pixels keep busy, each with neighbouring screens. `remote`: displays outside the job show them.
std::vector<int> owners_of(const Wall& wall, const std::vector<std::string>& hosts, bool remote) {
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
    if (screen.rank < 0 && on_its_host.empty() && !any_host && !remote) {
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

}  // namespace

Sampling sampling_of(const WallRun& run) {
  Sampling sampling = run.options.sampling();
  if (!run.target_error) return sampling;
  sampling.goal.relmse = run.target_error;
  if (!run.options.spp) sampling.goal.samples.reset();
  return sampling;
}

WallDriver::WallDriver(const WallRun& run, const Wall& wall, const FrameSettings& settings, const Globals& globals,
                       Session& session)
    : run_(run),
      wall_(wall),
      session_(session),
      path_(run.path.empty() ? std::optional<CameraPath>() : load_camera_path(run.path)),
      frames_(session, settings, sampling_of(run), screens_in(0), run.target_ms),
      showing_{sizes_of(wall), owners_of(wall, hosts_of(session.comm(), session.host()), run.display == kRemoteDisplay),
               run.options.exposure} {
  if (run.display == kRemoteDisplay) {
    remote_ = connect_displays(session_.comm(), wall, showing_.shown_by, run.remote);
  }
  agree_on_failure(session_.comm(), [&] {
    if (shows_any() && !remote_)
      display_ = make_display(run.display, wall, {.folder = run.folder, .overwrite = globals.force});
  });
  manifest_.scene_hash = content_hash(session.scene());
  manifest_.wall_hash = wall.hash;
  manifest_.seed = globals.seed;
  manifest_.versions = {
      {"hpr", std::string(kVersion)}, {"commit", std::string(kCommit)}, {"gl", session.gl().description()}};
}

WallDriver::~WallDriver() = default;

void WallDriver::draw(std::uint64_t number, Progress& progress) {
  const Stopwatch watch;
  const std::size_t sent_before = session_.comm().bytes_sent();
  Frame& frame = frames_.make(screens_in(number), number, progress);
  pictures_ = bring_to_screens(session_, frame, frames_.blocks(), showing_);
  last_cost_ = {watch.ms(), session_.comm().bytes_sent() - sent_before};
  agree_on_failure(session_.comm(), [&] { show(number); });
  record(number);
}

bool WallDriver::finish() {
  return !remote_ || end_displays(session_.comm(), *remote_, manifest_);
}

std::vector<Image<Rgba8>> WallDriver::collect_pictures() {
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

std::vector<View> WallDriver::screens_in(std::uint64_t frame) const {
  const Camera camera = path_ ? camera_of(path_->at_frame(frame, static_cast<std::size_t>(run_.frames)))
                              : run_.options.choose_camera(session_.scene());
  return wall_views(wall_, camera, session_.scene().bounds);
}

bool WallDriver::shows_any() const {
  return std::ranges::find(showing_.shown_by, session_.comm().rank()) != showing_.shown_by.end();
}

void WallDriver::show(std::uint64_t number) {
  if (!display_ && !remote_) return;
  std::vector<ScreenPicture> mine;
  for (std::size_t screen = 0; screen < showing_.shown_by.size(); ++screen) {
    if (showing_.shown_by[screen] == session_.comm().rank()) mine.push_back({screen, pictures_[screen]});
  }
  if (remote_) {
    remote_->show({number, mine});
  } else {
    display_->show({number, mine});
  }
}

/// Every rank hashes what it showed; rank 0 writes it down.
void WallDriver::record(std::uint64_t number) {
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

std::string WallDriver::strategy() const {
  const FramePlan& made = plan();
  if (made.mine.group.size() == 1) return std::string(name_of(made.distribution));
  return std::string(session_.compositor(made.strategy, made.mine.group).chosen());
}

}  // namespace hpr
