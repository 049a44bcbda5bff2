#include "engine/wall/wall_driver.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <hpr/version.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iterator>
#include <sstream>
#include <utility>

#include "cluster/transport/collectives.h"
#include "cluster/transport/communicator.h"
#include "compositing/assembly.h"
#include "compositing/compositor.h"
#include "core/bytes.h"
#include "core/file.h"
#include "core/interrupt.h"
#include "core/job_board.h"
#include "core/log.h"
#include "core/signals.h"
#include "core/text.h"
#include "core/timing.h"
#include "engine/output.h"
#include "engine/settings_table.h"
#include "engine/wall/wall_displays.h"
#include "engine/wall/wall_status.h"
#include "raster/gl_context.h"
#include "walls/geometry/geometry.h"
#include "walls/link/sender.h"
#include "walls/manifest/manifest.h"
#include "walls/manifest/run_journal.h"

namespace hpr {
namespace {

/// Of each picture that is drawn, its screen's rank.
std::vector<int> picture_owners(const Wall& wall, const std::vector<int>& owners) {
  std::vector<int> shown_by;
  for (const ScreenEye& picture : screen_eyes(wall)) shown_by.push_back(owners[picture.screen]);
  return shown_by;
}

/// OpenGL needs other pictures than rays where screens are no planes, so the choice is not left to choose_primary().
FrameSettings settings_for(const Wall& wall, FrameSettings settings) {
  const bool curved = std::ranges::any_of(wall.screens, has_position_map);
  if (curved && settings.primary == Primary::Auto) settings.primary = Primary::Rays;
  return settings;
}

/// The default target time of a frame while a viewer moves the camera.
std::optional<double> target_of(const WallJob& job) {
  constexpr double kResponsive_ms = 50.0;
  if (job.target_ms || !job.open_ended()) return job.target_ms;
  return kResponsive_ms;
}

/// How long the ranks may stand still between frames whose slowest took as long as that.
std::chrono::nanoseconds stall_limit_of(const WallJob& job, double slowest_ms) {
  using Nanoseconds = std::chrono::nanoseconds;
  constexpr std::chrono::seconds kMinLimit{10};
  constexpr std::chrono::seconds kShownHere{45};  // windows and pipes have limits of their own, of 30 s
  constexpr double kFrames = 5.0;
  if (job.stall_limit) return *job.stall_limit;
  if (!job.outputs.assembled.empty()) return kHangTimeout;  // a disk may take its time
  const std::chrono::duration<double, std::milli> limit(kFrames * slowest_ms);
  const auto budget = job.link ? std::chrono::duration_cast<Nanoseconds>(job.link->send_budget) : Nanoseconds::zero();
  const bool shows_here = !job.link && job.display->name != "none";
  return std::max<Nanoseconds>((shows_here ? kShownHere : kMinLimit) + budget,
                               std::chrono::duration_cast<Nanoseconds>(limit));
}

/// While nobody moves the camera, the picture of an open-ended run gets better.
std::optional<SampleGoal> resting_of(const WallJob& job, const RenderSettings& settings) {
  constexpr std::uint32_t kSamplesWhileResting = 64;
  if (!job.open_ended() || job.target_relmse || settings.is_given("spp")) return std::nullopt;
  return SampleGoal{.samples = kSamplesWhileResting, .seconds = {}, .relmse = {}};
}

/// Pictures that are bent or shown through colored glasses, or that codecs carry, come before black.
AlphaUse alpha_use_of(const WallJob& job) {
  const bool is_kept = job.display->keeps_alpha != nullptr && job.display->keeps_alpha(job.display_options);
  const bool is_mixed =
      job.wall.stereo == StereoMode::Anaglyph || std::ranges::any_of(job.wall.screens, has_position_map);
  return is_kept && !is_mixed && !job.link ? AlphaUse::Straight : AlphaUse::OverBlack;
}

/// A viewer is to see each frame as soon as it is drawn, and what comes once has no frame to come after it.
bool shows_while_drawing(const WallJob& job) {
  return job.display->shows_on_any_thread && !job.link && !job.open_ended() && job.frame_count() > 1;
}

}  // namespace

WallDriver::WallDriver(const WallJob& job, Session& session)
    : job_(job),
      wall_(job.wall),
      session_(session),
      heads_(wall_, session.comm()),
      monitors_(wall_),
      settings_(job.settings),
      start_(choose_camera(settings_.camera, session.scene())),
      fov_degrees_(settings_.camera.fov_degrees),
      orbit_(start_, session.scene().bounds),
      control_(
          session, settings_, job.seed, job.load, [this] { return status(); }, [this] { plan_frames(); },
          [this](const std::string& line) {
            if (journal_) journal_->add_command(line);
          }),
      hosts_(all_gather_texts(session.comm(), session.host())),
      owners_(owners_of(wall_, hosts_, job.link.has_value())),
      shows_while_drawing_(shows_while_drawing(job)) {
  control_.reject_change("aov", "its files are named before a wall starts");
  if (job_.path) control_.reject_change("camera", "it follows --path");
  if (job_.display->whole_wall) std::ranges::fill(owners_, 0);
  start_frames();
  if (job_.link) remote_ = connect_displays(session_.comm(), wall_, owners_, *job_.link);
  agree_on_failure(session_.comm(), [&] {
    DisplayOptions options = job_.display_options;
    options.screens.emplace();
    for (std::size_t screen = 0; screen < owners_.size(); ++screen) {
      if (owners_[screen] == session_.comm().rank()) options.screens->push_back(screen);
    }
    if (shows_any() && !remote_) display_ = job_.display->make(wall_, options);
    if (display_ && shows_while_drawing_) background_.emplace(*display_);
  });
  manifest_.scene_hash = content_hash(session.scene());
  manifest_.wall_hash = wall_.hash;
  manifest_.seed = job_.seed;
  manifest_.versions = {
      {"hpr", std::string(kVersion)}, {"commit", std::string(kCommit)}, {"gl", session.gl_description()}};
  take_over();
}

/// With the settings as they are now.
void WallDriver::start_frames() {
  const RenderSettings settings = resolve(settings_, job_.seed);
  const std::vector<View> views = screens_in(0, resting_heads(wall_));
  const FrameSettings used = settings_for(wall_, settings.frame);
  curved_.emplace(views, used.primary == Primary::Rays);
  for (const Size& size : curved_->sizes()) check_size(size, job_.picture_limits);
  showing_ = {curved_->sizes(), picture_owners(wall_, owners_), {}, alpha_use_of(job_)};
  display_settings_ = settings.display;
  frames_.emplace(session_, used, sampling_of(job_, settings), curved_->drawn(views), target_of(job_),
                  resting_of(job_, settings), !job_.outputs.layers.raw.empty());
}

std::vector<std::string> WallDriver::explained() const {
  std::vector<std::string> lines = plan().explained;
  std::size_t flat = 0;
  const std::vector<ScreenEye> pictures = screen_eyes(wall_);
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    if (has_position_map(wall_.screens[pictures[i].screen])) flat += curved_->sizes()[i].area();
  }
  if (flat == 0) return lines;
  const auto count = std::ranges::count_if(wall_.screens, has_position_map);
  const std::string what = fmt::format("warp: position maps of {} screen{}", count, count == 1 ? "" : "s");
  lines.push_back(plan().primary == Primary::Rays
                      ? what + ", rays go through their points"
                      : fmt::format("{}, seen in flat pictures of {:.2f} million pixels (rays would be exact)", what,
                                    static_cast<double>(flat) * 1e-6));
  return lines;
}

/// What an earlier job of this run did before it was lost, or stopped.
void WallDriver::take_over() {
  std::string commands;
  agree_on_failure(session_.comm(), [&] {
    if (session_.comm().rank() != 0) return;
    RunJournal::Entries entries;
    if (auto journal = RunJournal::of_supervisor()) {
      journal_.emplace(std::move(*journal));
      entries = journal_->read();
    }
    commands = fmt::format("{}", fmt::join(entries.commands, "\n"));
    if (job_.resume && entries.frames.empty()) resume(entries.frames);
    const std::size_t entries_count = entries.frames.size();
    if (!job_.open_ended()) {
      // The last picture is needed for what is written at the end.
      entries.frames.resize(std::min(entries.frames.size(), static_cast<std::size_t>(job_.frame_count() - 1)));
      first_frame_ = entries.frames.size();
      manifest_.earlier = std::move(entries.frames);
    }
    std::ranges::move(entries.restarts, std::back_inserter(manifest_.restarts));
    if (journal_ && !job_.open_ended()) journal_->add_begin();
    journaled_ = entries_count;
    for (const std::uint64_t frame : failed_frames(manifest_.earlier)) failed_.add_failed(frame);
    failed_.add_drawn();
  });
  first_frame_ = all_gather_value(session_.comm(), first_frame_)[0];
  replay(commands);
}

/// `lines`: on rank 0, the commands that the run carried out before, one a line.
void WallDriver::replay(const std::string& lines) {
  std::istringstream text(broadcast_text(session_.comm(), lines));
  std::vector<std::string> commands;
  for (std::string line; std::getline(text, line);) commands.push_back(line);
  if (commands.empty()) return;
  control_.replay(commands);
  plan_frames();
}

/// Goes on after what the folder's manifest has, where there is one.
void WallDriver::resume(std::vector<std::string>& frames) {
  std::error_code error;
  if (!std::filesystem::exists(job_.outputs.manifest, error)) return;
  ManifestFile before = load_manifest(job_.outputs.manifest.string());
  const int frame_count = job_.frame_count();
  std::string other;
  if (before.wall_hash != manifest_.wall_hash) other = "another wall";
  if (before.scene_hash != manifest_.scene_hash) other = "another scene";
  if (before.seed != manifest_.seed) other = fmt::format("seed {}", before.seed);
  const int of = before.stopped_of.value_or(static_cast<int>(before.frames.size()));
  if (of != frame_count) other = fmt::format("{} frames", of);
  if (!other.empty()) {
    throw Error(ExitCode::BadInput,
                fmt::format("'{}' is of a run with {}", printable(job_.outputs.manifest.string(), 200), other),
                "go on with the same command line, or begin anew with --force in place of --resume");
  }
  check_records(before, wall_.screens, job_.outputs.manifest.string());
  log::info("going on after {} of {} frames", before.frames.size(), frame_count);
  frames = std::move(before.frames);
  manifest_.restarts = std::move(before.restarts);
  // A job that is lost from here on starts again from all that was done.
  if (!journal_) return;
  for (const std::string& frame : frames) journal_->add_frame(frame);
  for (const std::string& restart : manifest_.restarts) journal_->keep_restart(restart);
}

bool WallDriver::apply_commands() {
  report_step();
  control_.poll();
  return !control_.stops();
}

void WallDriver::plan_frames() {
  // Other settings or scenes may take longer than any frame before.
  report_stall_limit(std::chrono::nanoseconds::zero());
  slowest_ms_ = 0.0;
  const Camera start = choose_camera(settings_.camera, session_.scene());
  if (start.eye != start_.eye || start.axes != start_.axes || settings_.camera.fov_degrees != fov_degrees_) {
    orbit_ = OrbitCamera(start, session_.scene().bounds);
    start_ = start;
    fov_degrees_ = settings_.camera.fov_degrees;
  }
  start_frames();
}

std::string WallDriver::status() const {
  WallStatusRecord record{.run = ::getpid(),
                          .wall = wall_.name,
                          .scene = session_.scene().name,
                          .ranks = session_.comm().size(),
                          .restarts = manifest_.restarts};
  if (!manifest_.frames.empty()) {
    record.frame = manifest_.frames.back().frame;
    record.ms = manifest_.frames.back().ms;
    const std::vector<ScreenState> now = states();
    for (std::size_t i = 0; i < now.size(); ++i) record.screens.emplace_back(wall_.screens[i].id, now[i]);
  }
  return to_json(record);
}

WallDriver::~WallDriver() = default;

bool WallDriver::draw(std::uint64_t number, Progress& progress) {
  const trace::Span span("frame", "number", number);
  report_frame(number);
  const Stopwatch watch;
  const std::size_t sent_before = session_.comm().bytes_sent();
  const std::vector<View> views = screens_in(number, heads_.at(number));
  verified_ = {};
  bool is_new = true;
  const std::optional<Error> failure = draw_with_retry(session_.comm(), fmt::format("frame {}", number),
                                                       [&] { is_new = make_pictures(views, number, progress); });
  if (!failure && !is_new) return false;
  last_cost_ = {watch.ms(), session_.comm().bytes_sent() - sent_before};
  if (failure) {
    failed_.add_failed(number);
    if (!pictures_ || failed_.in_a_row() >= kMaxFailedInARow) throw AgreedError(*failure);
    if (session_.rank() == 0) log::error("frame {} failed: {}", number, failure->what());
  } else {
    failed_.add_drawn();
  }
  agree_on_failure(session_.comm(), [&] {
    wait_until_shown();
    show(number);
  });
  if (!background_) shown_ms_ = watch.ms();
  record(number, failure);
  return true;
}

/// Takes what came on this rank and adds it to what waits for follow_viewers(); whether anything did, a command too.
bool WallDriver::take_news() {
  if (display_) news_.input += display_->take_input();
  news_.interrupt = news_.interrupt || take_request() == Request::Stop;
  return news_.interrupt || news_.input != DisplayInput{} || control_.any_waiting();
}

bool WallDriver::make_pictures(const std::vector<View>& views, std::uint64_t number, Progress& progress) {
  try {
    Interrupt interrupt([this] { return take_news(); });
    Frame* const made = frames_->make(curved_->drawn(views), number, progress, &interrupt);
    if (made == nullptr) return false;
    Frame& frame = *made;
    verified_ += frames_->verified();
    if (const std::uint64_t unmended = frames_->verified().unmended; unmended > 0) {
      throw AgreedError(ExitCode::CheckFailed,
                        fmt::format("of {} tile{} no two of three drawings agree", unmended, unmended == 1 ? "" : "s"),
                        "memory, a GPU or a link of these ranks flips bits: replace it");
    }
    showing_.transform = transform_for(session_, frame, frames_->blocks().views, display_settings_);
    shows_again_ = false;
    SmoothExposure exposure = exposure_;
    if (!display_settings_.exposure_stops) {
      showing_.transform.exposure_stops = exposure.next(showing_.transform.exposure_stops);
    }
    std::vector<Image<Rgba8>> pictures = bring_to_screens(session_, frame, frames_->blocks(), showing_);
    curved_->finish(views, pictures, session_.threads());
    pictures = compose_screens(wall_, std::move(pictures));
    std::vector<Image<Rgba8>> monitor_pictures = monitors_.draw(session_.comm(), pictures, owners_);
    // The last ones may still be shown.
    pictures_ = std::make_shared<WallPictures>(WallPictures{std::move(pictures), std::move(monitor_pictures)});
    exposure_ = exposure;
    return true;
  } catch (...) {
    frames_->discard();
    throw;
  }
}

bool WallDriver::follow_viewers() {
  (void)take_news();
  const News mine = std::exchange(news_, {});
  DisplayInput all;
  for (const News& viewer : all_gather_value(session_.comm(), mine)) {
    all += viewer.input;
    interrupted_ = interrupted_ || viewer.interrupt;
  }
  orbit_.move(all.orbit);
  apply_keys(all.keys);
  return !all.stop && !interrupted_;
}

/// As a command would, so that a job that is lost goes on with it.
void WallDriver::change_setting(const std::string& name, const std::string& value) {
  set_setting(settings_, name, value);
  if (journal_) journal_->add_command(fmt::format("set {} {}", name, value));
}

void WallDriver::apply_keys(const ViewKeys& keys) {
  if (keys.half_stops != 0) {
    constexpr double kMaxStops = 30.0;
    const double stops = showing_.transform.exposure_stops + 0.5 * keys.half_stops;
    change_setting("exposure", fmt::format("{}", std::clamp(stops, -kMaxStops, kMaxStops)));
  }
  if (keys.tones != 0) {
    const auto next = static_cast<std::size_t>(settings_.display.tone) + static_cast<std::size_t>(keys.tones);
    change_setting("tone", std::string(kToneNames.at(next % kToneNames.size())));
  }
  if (keys.wireframes % 2 != 0) {
    const Show now = settings_.frame.rays.show;
    if (now != Show::Wireframe) show_before_wireframe_ = now;
    change_setting("show", std::string(name_of(now == Show::Wireframe ? show_before_wireframe_ : Show::Wireframe)));
    plan_frames();
  } else if (keys.half_stops != 0 || keys.tones != 0) {
    display_settings_ = resolve(settings_, job_.seed).display;
    shows_again_ = true;
  }
}

bool WallDriver::settled() {
  const std::uint64_t last = manifest_.frames.empty() ? 0 : manifest_.frames.back().frame;
  if (shows_again_ || job_.path || heads_.plays_on(last)) return false;
  return frames_->refined(curved_->drawn(screens_in(0, heads_.at(last + 1))));
}

bool WallDriver::finish() {
  report_stall_limit({});  // results may take as long as they like to be gathered and written
  agree_on_failure(session_.comm(), [&] {
    wait_until_shown();
    if (display_) display_->finish();
  });
  if (shows_while_drawing_ && !manifest_.frames.empty()) {
    (void)record_screens(false);
    finish_record(manifest_.frames.back());
  }
  if (journal_) journal_->add_end();
  return !remote_ || end_displays(session_.comm(), *remote_, job_.link->fail_on, manifest_);
}

std::vector<Image<Rgba8>> WallDriver::collect_pictures() {
  Communicator& comm = session_.comm();
  if (background_) background_->wait();  // it reads them
  for (std::size_t screen = 0; screen < owners_.size(); ++screen) {
    const int from = owners_[screen];
    if (from == 0) continue;
    std::vector<Image<Rgba8>>& pictures = pictures_->screens;
    if (comm.rank() == from) comm.send(std::as_bytes(pictures[screen].pixels()), 0);
    if (comm.rank() == 0) {
      pictures[screen] = Image<Rgba8>(wall_.screens[screen].pixels);
      comm.receive(std::as_writable_bytes(pictures[screen].pixels()), from);
    }
  }
  return std::move(pictures_->screens);
}

std::vector<View> WallDriver::screens_in(std::uint64_t frame, std::span<const HeadPose> heads) const {
  const auto frames = static_cast<std::size_t>(job_.frame_count());
  const Camera camera = job_.path ? camera_of(job_.path->at_frame(frame, frames)) : orbit_.camera();
  return wall_views(wall_, heads, camera, session_.scene().bounds);
}

bool WallDriver::shows_any() const {
  const bool shows_monitors = job_.display->monitors && monitors_.any() && session_.comm().rank() == 0;
  return shows_monitors || std::ranges::find(owners_, session_.comm().rank()) != owners_.end();
}

void WallDriver::show(std::uint64_t number) {
  if (!display_ && !remote_) return;
  std::vector<std::size_t> mine;
  for (std::size_t screen = 0; screen < owners_.size(); ++screen) {
    if (owners_[screen] == session_.comm().rank()) mine.push_back(screen);
  }
  if (background_) {
    background_->show(number, pictures_, std::move(mine));
    return;
  }
  const trace::Span span("show");
  if (!remote_) {
    show_pictures(*display_, number, *pictures_, mine);
    costs_ = display_->costs();
    return;
  }
  std::vector<ScreenPicture> screens;
  for (const std::size_t screen : mine) screens.push_back({screen, pictures_->screens[screen]});
  remote_->show({number, screens, {}});
  costs_ = remote_->costs();
}

/// Waits for the frame that is shown on another thread.
void WallDriver::wait_until_shown() {
  if (!background_) return;
  const trace::Span span("wait for display");
  background_->wait();
  shown_ms_ = background_->shown_ms();
  costs_ = display_->costs();
}

/// Collects the records of the screens of all ranks on rank 0. What showing them took is that of the last frame that
/// was shown: where frames are shown while the next is drawn, it goes to the last record. No new frame: to that alone.
std::vector<ScreenRecord> WallDriver::record_screens(bool of_new_frame) {
  // Per screen its hash, its bytes, and the microseconds it took and one; 0: not known.
  const std::size_t count = owners_.size();
  std::vector<std::uint64_t> reported(3 * count, 0);
  for (std::size_t screen = 0; screen < count; ++screen) {
    if (!of_new_frame || owners_[screen] != session_.comm().rank()) continue;
    reported[screen] = record_screen(wall_.screens[screen].id, pictures_->screens[screen], ScreenState::Fresh).xxh64;
  }
  for (const ScreenCost& cost : costs_) {
    reported[count + cost.screen] = cost.bytes;
    reported[2 * count + cost.screen] = static_cast<std::uint64_t>(1000.0 * cost.ms) + 1;
  }
  session_.comm().reduce_max(reported, 0);  // all but the owner's are 0
  std::vector<ScreenRecord> screens;
  for (std::size_t i = 0; i < count; ++i) {
    screens.push_back({wall_.screens[i].id, wall_.screens[i].pixels, reported[i], ScreenState::Fresh, owners_[i]});
  }
  std::vector<ScreenRecord>* shown = &screens;
  if (shows_while_drawing_) shown = manifest_.frames.empty() ? nullptr : &manifest_.frames.back().screens;
  for (std::size_t i = 0; shown != nullptr && i < count; ++i) {
    const std::uint64_t microseconds = reported[2 * count + i];
    if (microseconds == 0) continue;
    (*shown)[i].ms = static_cast<double>(microseconds - 1) / 1000.0;
    (*shown)[i].bytes = reported[count + i];
  }
  return screens;
}

/// Once the frame was shown: its record is whole.
void WallDriver::finish_record(FrameRecord& frame) {
  // Of an open-ended run only now and then: that it gets on is all that counts.
  constexpr std::uint64_t kFramesPerEntry = 1000;
  const bool is_news = job_.frames ? frame.frame >= journaled_ : frame.frame % kFramesPerEntry == 0;
  if (journal_ && is_news) journal_->add_frame(to_json(frame));
}

void WallDriver::record(std::uint64_t number, const std::optional<Error>& failure) {
  const double slowest = std::ranges::max(all_gather_value(session_.comm(), last_cost_.ms));
  slowest_ms_ = std::max({slowest_ms_, slowest, shown_ms_});
  report_stall_limit(stall_limit_of(job_, slowest_ms_));
  FrameRecord frame{number, slowest, strategy(), record_screens(true)};
  if (shows_while_drawing_ && !manifest_.frames.empty()) finish_record(manifest_.frames.back());
  if (failure) {
    frame.failed = failure->what();
    for (ScreenRecord& screen : frame.screens) screen.state = ScreenState::Stale;
  } else {
    frames_->record_frame_time(slowest);
    if (frames_->report()) frame.budget = to_record(*frames_->report());
    frame.exposure_stops = showing_.transform.exposure_stops;
    frame.tone = name_of(showing_.transform.tone);
    const std::vector<RankWork> works = works_of(session_, *frames_);
    frame.slowest = slowest_of(works, *frames_, hosts_);
    warn_of_slow_ranks(works);
  }
  if (plan().verify_percent > 0.0) frame.verify = to_record({plan().verify_percent, verified_});
  frame.heads = heads_.report();
  for (std::size_t monitor = 0; monitor < pictures_->monitors.size(); ++monitor) {
    frame.monitors.push_back(
        record_screen(wall_.monitors[monitor].id, pictures_->monitors[monitor], ScreenState::Fresh));
  }
  if (!shows_while_drawing_) finish_record(frame);
  // An open-ended run keeps its last frames only.
  constexpr std::size_t kMaxRecords = 10'000;
  if (!job_.frames && manifest_.frames.size() == kMaxRecords) {
    manifest_.frames.erase(manifest_.frames.begin(), manifest_.frames.begin() + kMaxRecords / 2);
    if (remote_ && session_.comm().rank() == 0) remote_->forget_before(manifest_.frames.front().frame);
  }
  manifest_.frames.push_back(std::move(frame));
}

void WallDriver::warn_of_slow_ranks(std::span<const RankWork> works) {
  if (session_.rank() != 0) return;
  for (const SlowRank& slow : slow_ranks_.add(works, session_.comm().seconds())) {
    const std::string& host = hosts_[static_cast<std::size_t>(slow.rank)];
    log::warning("{}", describe(slow, host, pass_name(*frames_, slow.pass)));
  }
}

std::vector<ScreenState> WallDriver::states() const {
  const std::uint64_t last = manifest_.frames.empty() ? 0 : manifest_.frames.back().frame;
  // Displays have not reported the latest frames yet.
  const std::uint64_t awaited = job_.link ? static_cast<std::uint64_t>(job_.link->in_flight) + 1 : 0;
  if (remote_ && last >= first_frame_ + awaited) return remote_->outcome(last - awaited).screens;
  std::vector<ScreenState> all(owners_.size(), failed_.in_a_row() > 0 ? ScreenState::Stale : ScreenState::Fresh);
  return all;
}

std::string WallDriver::strategy() const {
  const FramePlan& made = plan();
  if (made.mine.group.size() == 1) return std::string(name_of(made.distribution));
  return std::string(session_.compositor(made.strategy, made.mine.group).chosen());
}

void write_layers(const WallLayerFiles& files, std::span<const Aov> aovs, WallDriver& driver, Session& session) {
  if (files.empty()) return;
  const trace::Span span("write layers");
  Frame& frame = driver.frames().frame();
  const Blocks& blocks = driver.frames().blocks();
  const std::vector<int> to_root(blocks.views.size(), 0);
  const auto collect = [&](auto& layer) { session.assembler().assemble(session.comm(), layer, frame.owned, to_root); };
  if (!files.raw.empty() || std::ranges::any_of(aovs, needs_keys)) collect(*frame.keys);
  if (!files.aov.empty()) collect(frame.radiance);
  for (auto& [which, layer] : frame.aovs.rgb) collect(layer);
  for (auto& [which, layer] : frame.aovs.single) collect(layer);
  agree_on_failure(session.comm(), [&] {
    if (session.rank() != 0) return;
    for (std::size_t i = 0; i < files.aov.size(); ++i) {
      write_file_atomically(files.aov[i],
                            encode_exr(join_blocks(frame.radiance, blocks, i), {{"hpr:scene", session.scene().name}},
                                       exr_layers(frame, blocks, i, aovs)));
    }
    for (std::size_t i = 0; i < files.raw.size(); ++i) {
      write_file_atomically(files.raw[i], std::as_bytes(join_blocks(*frame.keys, blocks, i).pixels()));
    }
  });
}

}  // namespace hpr
