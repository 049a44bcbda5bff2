#include "app/wall_driver.h"

#include <hpr/version.h>
#include <unistd.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "app/remote_wall.h"
#include "app/signals.h"
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
    const auto same_window =
        std::ranges::find(wall.screens.begin(), wall.screens.begin() + static_cast<std::ptrdiff_t>(i), screen.window,
                          &WallScreen::window);
    if (!screen.window.empty() && same_window != wall.screens.begin() + static_cast<std::ptrdiff_t>(i)) {
      owners.push_back(owners[static_cast<std::size_t>(same_window - wall.screens.begin())]);
      continue;
    }
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

/// Of each picture that is drawn, its screen's rank.
Showing showing_of(const Wall& wall, const std::vector<int>& owners, double exposure_stops) {
  Showing showing;
  for (const ScreenEye& picture : screen_eyes(wall)) {
    showing.sizes.push_back(picture.pixels);
    showing.shown_by.push_back(owners[picture.screen]);
  }
  showing.exposure_stops = exposure_stops;
  return showing;
}

std::vector<std::string> hosts_of(Communicator& comm, const std::string& mine) {
  std::vector<std::string> hosts;
  for (const auto& name : all_gather(comm, std::as_bytes(std::span(mine)))) {
    hosts.emplace_back(reinterpret_cast<const char*>(name.data()), name.size());
  }
  return hosts;
}

/// A viewer who moves the camera waits no longer for a frame, unless told otherwise.
std::optional<double> target_of(const WallRun& run) {
  constexpr double kResponsive_ms = 50.0;
  if (run.target_ms || !run.open_ended()) return run.target_ms;
  return kResponsive_ms;
}

/// While nobody moves the camera, the picture of an open-ended run gets better.
std::optional<SampleGoal> resting_of(const WallRun& run) {
  constexpr std::uint32_t kSamplesAtRest = 64;
  const Sampling sampling = sampling_of(run);
  if (!run.open_ended() || !sampling.goal.one() || run.options.spp) return std::nullopt;
  return SampleGoal{.samples = kSamplesAtRest, .seconds = {}, .relmse = {}};
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
      heads_(wall, session.comm()),
      monitors_(wall),
      globals_(globals),
      options_(run.options),
      start_(run.options.choose_camera(session.scene())),
      fov_degrees_(run.options.fov_degrees),
      orbit_(start_, session.scene().bounds),
      control_(session, globals, options_, [this] { return status(); }),
      owners_(owners_of(wall, hosts_of(session.comm(), session.host()), run.display.remote())),
      showing_(showing_of(wall, owners_, run.options.exposure)) {
  if (run.display.kind().whole_wall) {
    std::ranges::fill(owners_, 0);
    showing_ = showing_of(wall, owners_, run.options.exposure);
  }
  frames_.emplace(session, settings, sampling_of(run), screens_in(0, resting_heads(wall)), target_of(run),
                  resting_of(run));
  if (run.display.remote()) remote_ = connect_displays(session_.comm(), wall, owners_, run.remote);
  agree_on_failure(session_.comm(), [&] {
    DisplayOptions options = run.display.options(globals);
    for (std::size_t screen = 0; screen < owners_.size(); ++screen) {
      if (owners_[screen] == session_.comm().rank()) options.screens.push_back(screen);
    }
    if (shows_any() && !remote_) display_ = run.display.kind().make(wall, options);
  });
  manifest_.scene_hash = content_hash(session.scene());
  manifest_.wall_hash = wall.hash;
  manifest_.seed = globals.seed;
  manifest_.versions = {
      {"hpr", std::string(kVersion)}, {"commit", std::string(kCommit)}, {"gl", session.gl().description()}};
  take_over();
}

/// What an earlier job of this run did before it was lost.
void WallDriver::take_over() {
  std::uint64_t done = 0;
  auto journal = session_.comm().rank() == 0 ? RunJournal::of_supervisor() : std::nullopt;
  if (journal) {
    journal_.emplace(std::move(*journal));
    RunJournal::Entries entries = journal_->read();
    if (!run_.open_ended()) {
      // The last picture is needed for what is written at the end.
      const auto most = static_cast<std::size_t>(run_.frames.value_or(1) - 1);
      entries.frames.resize(std::min(entries.frames.size(), most));
      done = entries.frames.size();
      manifest_.earlier = std::move(entries.frames);
    }
    manifest_.restarts = std::move(entries.restarts);
  }
  first_frame_ = all_gather_value(session_.comm(), done)[0];
}

bool WallDriver::obey() {
  if (control_.attend(std::chrono::milliseconds(0))) plan_frames();
  return !control_.stops();
}

void WallDriver::plan_frames() {
  WallRun changed = run_;
  changed.options = options_;
  showing_.exposure_stops = options_.exposure;
  const Camera start = options_.choose_camera(session_.scene());
  if (start.eye != start_.eye || start.axes != start_.axes || options_.fov_degrees != fov_degrees_) {
    orbit_ = OrbitCamera(start, session_.scene().bounds);
    start_ = start;
    fov_degrees_ = options_.fov_degrees;
  }
  frames_.emplace(session_, options_.settings(globals_.seed), sampling_of(changed), screens_in(0, resting_heads(wall_)),
                  target_of(run_), resting_of(changed));
}

std::string WallDriver::status() const {
  using Json = nlohmann::ordered_json;
  Json screens = Json::array();
  Json restarts = Json::array();
  const bool drawn = !manifest_.frames.empty();
  if (drawn) {
    for (const ScreenRecord& screen : manifest_.frames.back().screens) {
      screens.push_back(Json{{"id", screen.id}, {"state", to_string(screen.state)}});
    }
  }
  for (const std::string& restart : manifest_.restarts) restarts.push_back(Json::parse(restart));
  const Json document{{"schema", "hpr.wall-status/1"},
                      {"run", ::getpid()},
                      {"wall", wall_.name},
                      {"scene", session_.scene().name},
                      {"ranks", session_.comm().size()},
                      {"frame", drawn ? manifest_.frames.back().frame : 0},
                      {"ms", drawn ? manifest_.frames.back().ms : 0.0},
                      {"screens", std::move(screens)},
                      {"restarts", std::move(restarts)}};
  return document.dump(2, ' ', false, Json::error_handler_t::replace);
}

WallDriver::~WallDriver() = default;

void WallDriver::draw(std::uint64_t number, Progress& progress) {
  const Stopwatch watch;
  const std::size_t sent_before = session_.comm().bytes_sent();
  last_heads_ = heads_.at(number);
  Frame& frame = frames_->make(screens_in(number, last_heads_), number, progress);
  pictures_ = compose_screens(wall_, bring_to_screens(session_, frame, frames_->blocks(), showing_));
  copies_ = monitors_.draw(session_.comm(), pictures_, owners_);
  last_cost_ = {watch.ms(), session_.comm().bytes_sent() - sent_before};
  agree_on_failure(session_.comm(), [&] { show(number); });
  record(number);
}

bool WallDriver::follow_viewers() {
  DisplayInput mine = display_ ? display_->take_input() : DisplayInput{};
  if (run_.open_ended() && take_request() == Request::Stop) mine.stop = true;
  OrbitInput motion;
  bool stop = false;
  for (const DisplayInput& input : all_gather_value(session_.comm(), mine)) {
    motion += input.orbit;
    stop = stop || input.stop;
  }
  orbit_.move(motion);
  return !stop;
}

bool WallDriver::settled() const {
  return !path_ && frames_->refined(screens_in(0, last_heads_));
}

bool WallDriver::finish() {
  agree_on_failure(session_.comm(), [&] {
    if (display_) display_->finish();
  });
  if (journal_) journal_->add_end();
  return !remote_ || end_displays(session_.comm(), *remote_, manifest_);
}

std::vector<Image<Rgba8>> WallDriver::collect_pictures() {
  Communicator& comm = session_.comm();
  for (std::size_t screen = 0; screen < owners_.size(); ++screen) {
    const int from = owners_[screen];
    if (from == 0) continue;
    if (comm.rank() == from) comm.send(std::as_bytes(pictures_[screen].pixels()), 0);
    if (comm.rank() == 0) {
      pictures_[screen] = Image<Rgba8>(wall_.screens[screen].pixels);
      comm.receive(std::as_writable_bytes(pictures_[screen].pixels()), from);
    }
  }
  return std::move(pictures_);
}

std::vector<View> WallDriver::screens_in(std::uint64_t frame, std::span<const HeadPose> heads) const {
  const auto frames = static_cast<std::size_t>(run_.frames.value_or(1));
  const Camera camera = path_ ? camera_of(path_->at_frame(frame, frames)) : orbit_.camera();
  return wall_views(wall_, heads, camera, session_.scene().bounds);
}

bool WallDriver::shows_any() const {
  const bool shows_monitors = monitors_.any() && session_.comm().rank() == 0;
  return shows_monitors || std::ranges::find(owners_, session_.comm().rank()) != owners_.end();
}

void WallDriver::show(std::uint64_t number) {
  if (!display_ && !remote_) return;
  std::vector<ScreenPicture> mine;
  for (std::size_t screen = 0; screen < owners_.size(); ++screen) {
    if (owners_[screen] == session_.comm().rank()) mine.push_back({screen, pictures_[screen]});
  }
  if (remote_) {
    remote_->show({number, mine, {}});
    return;
  }
  std::vector<MonitorPicture> monitors;
  for (std::size_t monitor = 0; monitor < copies_.size(); ++monitor) monitors.push_back({monitor, copies_[monitor]});
  display_->show({number, mine, monitors});
}

/// Every rank hashes what it showed; rank 0 writes it down.
void WallDriver::record(std::uint64_t number) {
  std::vector<std::uint64_t> hashes(owners_.size(), 0);
  for (std::size_t screen = 0; screen < owners_.size(); ++screen) {
    if (owners_[screen] == session_.comm().rank()) {
      hashes[screen] = record_screen(wall_.screens[screen].id, pictures_[screen], ScreenState::Fresh).xxh64;
    }
  }
  const double slowest = std::ranges::max(all_gather_value(session_.comm(), last_cost_.ms));
  session_.comm().reduce_max(hashes, 0);  // all but the owner's are 0
  frames_->took(slowest);
  FrameRecord frame{number, slowest, strategy(), {}, frames_->report()};
  for (std::size_t screen = 0; screen < hashes.size(); ++screen) {
    frame.screens.push_back(
        {wall_.screens[screen].id, wall_.screens[screen].pixels, hashes[screen], ScreenState::Fresh});
  }
  frame.heads = heads_.report();
  for (std::size_t monitor = 0; monitor < copies_.size(); ++monitor) {
    frame.monitors.push_back(record_screen(wall_.monitors[monitor].id, copies_[monitor], ScreenState::Fresh));
  }
  // Of an open-ended run only now and then: that it gets on is all that counts.
  constexpr std::uint64_t kSignOfLife = 1000;
  if (journal_ && (run_.frames || number % kSignOfLife == 0)) journal_->add_frame(to_json(frame));
  // An open-ended run keeps its last frames only.
  constexpr std::size_t kMostRecords = 10'000;
  if (!run_.frames && manifest_.frames.size() == kMostRecords) {
    manifest_.frames.erase(manifest_.frames.begin(), manifest_.frames.begin() + kMostRecords / 2);
  }
  manifest_.frames.push_back(std::move(frame));
}

std::string WallDriver::strategy() const {
  const FramePlan& made = plan();
  if (made.mine.group.size() == 1) return std::string(name_of(made.distribution));
  return std::string(session_.compositor(made.strategy, made.mine.group).chosen());
}

}  // namespace hpr
