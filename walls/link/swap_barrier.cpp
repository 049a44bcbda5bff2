#include "walls/link/swap_barrier.h"

#include <algorithm>
#include <utility>

#include "core/error.h"

namespace hpr {
namespace {

/// Frames that one screen is remembered to be ready for; a display holds fewer.
constexpr std::size_t kMaxReadyFrames = 64;
/// A display that is late for so long is worth a line in the log.
constexpr double kWorthALine = 1.0;

}  // namespace

SwapBarrier::SwapBarrier(const std::vector<std::size_t>& display_of, std::size_t displays, double timeout_s)
    : displays_(displays), timeout_s_(timeout_s) {
  screens_.reserve(display_of.size());
  for (const std::size_t display : display_of) {
    HPR_CHECK(display < displays);
    screens_.push_back({display, {}});
  }
}

void SwapBarrier::connected(std::size_t display, double now) {
  displays_[display].up = true;
  // It is waited for once it shows what the others show.
  displays_[display].late = posted_.has_value();
  displays_[display].late_since.reset();
  for (Screen& screen : screens_) {
    if (screen.display == display) screen.ready.clear();
  }
  count_degraded(now);
}

void SwapBarrier::gone(std::size_t display, double now) {
  Display& gone = displays_[display];
  if (!gone.up) return;
  gone = {.reported_lost = gone.reported_lost};
  for (auto& [number, frame] : frames_) {
    if (frame.presented) continue;
    for (std::size_t screen = 0; screen < screens_.size(); ++screen) {
      if (screens_[screen].display == display) frame.screens[screen] = ScreenState::Lost;
    }
  }
  if (posted_ && !gone.reported_lost) {
    gone.reported_lost = true;
    events_.push_back({SwapEvent::Kind::Lost, display, *posted_});
  }
  count_degraded(now);
}

void SwapBarrier::post(std::uint64_t number, double now) {
  HPR_CHECK(!posted_ || number > *posted_);
  posted_ = number;
  Frame frame;
  frame.shown.resize(displays_.size());
  frame.failed.resize(displays_.size());
  for (const Screen& screen : screens_) {
    frame.screens.push_back(displays_[screen.display].up ? ScreenState::Stale : ScreenState::Lost);
  }
  frames_.emplace(number, std::move(frame));
  for (std::size_t i = 0; i < displays_.size(); ++i) {
    if (displays_[i].up || displays_[i].reported_lost) continue;
    displays_[i].reported_lost = true;
    events_.push_back({SwapEvent::Kind::Lost, i, number});
  }
  count_degraded(now);
}

void SwapBarrier::ready(std::size_t screen, std::uint64_t number, double now) {
  if (screen >= screens_.size()) return;
  const auto frame = frames_.find(number);
  // Rank 0 may receive news of another rank's picture before it has posted the frame itself; of other frames, it never
  // posts.
  if (posted_ && number < *posted_ && frame == frames_.end()) return;
  Screen& of = screens_[screen];
  of.ready.insert(number);
  if (of.ready.size() > kMaxReadyFrames) of.ready.erase(of.ready.begin());
  if (presented_ && number <= *presented_) {
    late_decisions_.push_back({of.display, number, true});
  } else if (frame != frames_.end() && !frame->second.first_ready) {
    frame->second.first_ready = now;
  }
  if (displays_[of.display].late && presented_ && is_ready(of.display, *presented_)) catch_up(of.display, now);
}

void SwapBarrier::shown(std::size_t display, std::uint64_t number, double at) {
  const auto frame = frames_.find(number);
  if (frame != frames_.end() && !frame->second.shown[display]) frame->second.shown[display] = at;
  if (!displays_[display].failing) return;
  displays_[display].failing = false;
  events_.push_back({SwapEvent::Kind::Back, display, number});
  count_degraded(at);
}

void SwapBarrier::not_shown(std::size_t display, std::uint64_t number, double now) {
  const auto frame = frames_.find(number);
  if (frame != frames_.end()) frame->second.failed[display] = true;
  if (displays_[display].failing) return;
  displays_[display].failing = true;
  events_.push_back({SwapEvent::Kind::Failed, display, number});
  count_degraded(now);
}

std::uint64_t SwapBarrier::oldest_undecided() const {
  const std::uint64_t newest = posted_.value_or(0);
  return std::max(presented_ ? *presented_ + 1 : 0, newest - std::min<std::uint64_t>(newest, kMaxReadyFrames));
}

std::vector<SwapDecision> SwapBarrier::due(double now) {
  std::vector<SwapDecision> decisions = std::move(late_decisions_);
  late_decisions_.clear();
  for (auto frame = frames_.lower_bound(oldest_undecided()); frame != frames_.end(); ++frame) {
    // A screen that was ready before its frame was posted here starts the clock now.
    const bool any = std::ranges::any_of(screens_, [&](const Screen& s) { return s.ready.contains(frame->first); });
    if (!frame->second.first_ready && any) frame->second.first_ready = now;
    if (!frame->second.first_ready) continue;
    if (!all_ready(frame->first) && now < *frame->second.first_ready + timeout_s_) break;
    present(frame->first, now, decisions);
  }
  for (std::size_t i = 0; i < displays_.size(); ++i) {
    Display& display = displays_[i];
    if (!display.up || display.reported_stale || display.reported_lost || !display.late_since) continue;
    if (now - *display.late_since < kWorthALine) continue;
    display.reported_stale = true;
    events_.push_back({SwapEvent::Kind::Stale, i, *posted_});
  }
  return decisions;
}

std::optional<double> SwapBarrier::next_due() const {
  for (auto frame = frames_.lower_bound(oldest_undecided()); frame != frames_.end(); ++frame) {
    if (frame->second.first_ready) return *frame->second.first_ready + timeout_s_;
  }
  return std::nullopt;
}

bool SwapBarrier::all_ready(std::uint64_t number) const {
  for (std::size_t i = 0; i < displays_.size(); ++i) {
    if (waited_for(i, number) && !is_ready(i, number)) return false;
  }
  return true;
}

bool SwapBarrier::all_shown(std::uint64_t number) const {
  const auto frame = frames_.find(number);
  if (frame == frames_.end()) return true;
  for (std::size_t i = 0; i < displays_.size(); ++i) {
    if (waited_for(i, number) && !frame->second.shown[i] && !frame->second.failed[i]) return false;
  }
  return true;
}

void SwapBarrier::give_up(std::uint64_t number, double now) {
  for (std::size_t i = 0; i < displays_.size(); ++i) {
    if (waited_for(i, number) && !is_ready(i, number)) fall_behind(i, now);
  }
  count_degraded(now);
}

SwapOutcome SwapBarrier::outcome(std::uint64_t number) const {
  const Frame& frame = frames_.at(number);
  SwapOutcome outcome{frame.screens, {}};
  for (std::size_t i = 0; i < screens_.size(); ++i) {
    const std::size_t display = screens_[i].display;
    // Told to show it is not enough: it has to say that it did.
    if (outcome.screens[i] != ScreenState::Fresh || frame.shown[display]) continue;
    outcome.screens[i] = displays_[display].up ? ScreenState::Stale : ScreenState::Lost;
  }
  std::vector<double> times;
  for (std::size_t i = 0; i < displays_.size(); ++i) {
    const bool in_time = std::ranges::any_of(screens_, [&](const Screen& screen) {
      return screen.display == i &&
             outcome.screens[static_cast<std::size_t>(&screen - screens_.data())] == ScreenState::Fresh;
    });
    if (in_time && frame.shown[i]) times.push_back(*frame.shown[i]);
  }
  if (times.size() > 1) outcome.skew_s = std::ranges::max(times) - std::ranges::min(times);
  return outcome;
}

void SwapBarrier::forget_before(std::uint64_t frame) {
  // The latest two may still be asked for by what displays say of them.
  constexpr std::uint64_t kKept = 2;
  const std::uint64_t newest = posted_.value_or(0);
  frames_.erase(frames_.begin(), frames_.lower_bound(std::min(frame, newest - std::min(newest, kKept))));
}

double SwapBarrier::degraded_seconds(double now) const {
  return degraded_s_ + (degraded_since_ ? now - *degraded_since_ : 0.0);
}

std::vector<SwapEvent> SwapBarrier::take_events() {
  return std::exchange(events_, {});
}

bool SwapBarrier::is_ready(std::size_t display, std::uint64_t frame) const {
  return std::ranges::all_of(screens_, [&](const Screen& screen) {
    // Pictures come in order: who has a later frame ready will not have this one any more.
    return screen.display != display || (!screen.ready.empty() && *screen.ready.rbegin() >= frame);
  });
}

bool SwapBarrier::has_frame(std::size_t display, std::uint64_t frame) const {
  return std::ranges::any_of(
      screens_, [&](const Screen& screen) { return screen.display == display && screen.ready.contains(frame); });
}

bool SwapBarrier::waited_for(std::size_t display, std::uint64_t frame) const {
  return displays_[display].up && (!displays_[display].late || has_frame(display, frame));
}

void SwapBarrier::present(std::uint64_t number, double now, std::vector<SwapDecision>& decisions) {
  Frame& frame = frames_.at(number);
  frame.presented = true;
  presented_ = number;
  for (std::size_t i = 0; i < screens_.size(); ++i) {
    const bool up = displays_[screens_[i].display].up;
    const bool fresh = up && screens_[i].ready.contains(number);
    frame.screens[i] = !up ? ScreenState::Lost : fresh ? ScreenState::Fresh : ScreenState::Stale;
  }
  for (std::size_t i = 0; i < displays_.size(); ++i) {
    if (!displays_[i].up) continue;
    if (has_frame(i, number)) decisions.push_back({i, number, false});
    if (is_ready(i, number)) {
      if (displays_[i].late) catch_up(i, now);
    } else {
      fall_behind(i, now);
    }
  }
  count_degraded(now);
}

void SwapBarrier::fall_behind(std::size_t display, double now) {
  displays_[display].late = true;
  if (!displays_[display].late_since) displays_[display].late_since = now;
}

void SwapBarrier::catch_up(std::size_t display, double now) {
  Display& back = displays_[display];
  if (back.reported_lost || back.reported_stale) {
    events_.push_back({SwapEvent::Kind::Back, display, posted_.value_or(0)});
  }
  back = {.up = true, .failing = back.failing};
  count_degraded(now);
}

void SwapBarrier::count_degraded(double now) {
  const bool degraded = posted_ && std::ranges::any_of(displays_, [](const Display& each) {
                          return !each.up || each.late || each.failing;
                        });
  if (degraded && !degraded_since_) degraded_since_ = now;
  if (!degraded && degraded_since_) degraded_s_ += now - *std::exchange(degraded_since_, std::nullopt);
}

}  // namespace hpr
