#include "walls/link/display_process.h"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <filesystem>
#include <utility>

#include "core/bytes.h"
#include "core/error.h"
#include "core/file.h"
#include "core/json.h"
#include "core/log.h"
#include "image/image.h"
#include "walls/drawing/canvas.h"

namespace hpr {
namespace {

constexpr double kTick = 0.1;
constexpr std::chrono::milliseconds kStatusEvery{200};
constexpr double kRetryEveryMs = 1000.0;
constexpr int kBadgeHeight = 24;
constexpr Rgba8 kBadgeColor{176, 32, 32, 255};
constexpr Rgba8 kBadgeText{255, 255, 255, 255};

}  // namespace

std::string_view to_string(ShownState state) {
  switch (state) {
    case ShownState::Waiting:
      return "waiting";
    case ShownState::Fresh:
      return "fresh";
    case ShownState::Stale:
      return "stale";
    case ShownState::Failed:
      return "failed";
    case ShownState::Ended:
      break;
  }
  return "ended";
}

Image<Rgba8> with_badge(const Image<Rgba8>& picture, const std::string& label) {
  const int height = std::min(kBadgeHeight, std::max(1, picture.height() / 4));
  const double text = height * 0.6;
  const int width =
      std::min(picture.width(), static_cast<int>(text * 0.7 * static_cast<double>(label.size())) + height);
  PixelCanvas canvas({width, height});
  canvas.fill({0.0, 0.0}, {width, height}, kBadgeColor);
  canvas.text({width / 2.0, height / 2.0}, label, text, kBadgeText);
  Image<Rgba8> result = picture;
  paste(canvas.image(), 0, 0, result);
  return result;
}

DisplayProcess::DisplayProcess(const Wall& wall, std::string host, Display& display, FrameReceiver& receiver,
                               ProcessSettings settings)
    : wall_(wall),
      host_(std::move(host)),
      display_(display),
      receiver_(receiver),
      settings_(std::move(settings)),
      screens_(wall.screens.size()) {
  if (settings_.folder.empty()) return;
  write_status();
  writer_ = std::jthread([this](const std::stop_token& stop) {
    std::unique_lock lock(waiting_);
    while (!wake_.wait_for(lock, stop, kStatusEvery, [&] { return stop.stop_requested(); })) {
      try {
        write_status();
      } catch (const std::exception& error) {  // also where memory is short
        log::debug("{}", error.what());
      }
    }
  });
}

DisplayProcess::~DisplayProcess() {
  if (!writer_.joinable()) return;
  try {
    writer_.request_stop();
    writer_.join();
    write_status();
  } catch (const std::exception& error) {
    log::warning("{}", error.what());
  }
}

void DisplayProcess::run(const std::function<bool()>& stop) {
  while (!stop() && !display_.take_input().stop) {
    if (auto presentation = receiver_.next(kTick)) {
      present(*presentation);
    } else {
      retry();
    }
    const ReceiverReport report = receiver_.report();
    update(report);
    if (settings_.once && report.runs > 0 && report.idle && !report.connected) break;
  }
  display_.finish();
}

void DisplayProcess::present(Presentation& presentation) {
  std::vector<ScreenPicture> pictures;
  for (const auto& [screen, picture] : presentation.pictures) pictures.push_back({screen, picture});
  if (!pictures.empty() && !try_to_show({presentation.frame, pictures})) {
    receiver_.not_shown(presentation);
    unshown_ = std::move(presentation);
    return;
  }
  unshown_.reset();
  if (!receiver_.shown(presentation)) return;
  for (auto& [screen, picture] : presentation.pictures) {
    screens_[screen].picture = std::move(picture);
    screens_[screen].frame = presentation.frame;
  }
}

bool DisplayProcess::try_to_show(const WallFrame& frame) {
  try {
    display_.show(frame);
  } catch (const Error& error) {
    if (error.code() != ExitCode::Io || !display_.recovers()) throw;
    if (!failing_) log::error("{}: frame {} is not shown; {}", error.what(), frame.number, error.hint());
    failing_ = true;
    since_failure_.restart();
    return false;
  }
  if (failing_) log::info("frame {} is shown again", frame.number);
  failing_ = false;
  return true;
}

/// Nothing newer may come for long.
void DisplayProcess::retry() {
  if (!unshown_ || since_failure_.ms() < kRetryEveryMs) return;
  Presentation again = std::move(*unshown_);
  unshown_.reset();
  present(again);
}

void DisplayProcess::update(const ReceiverReport& report) {
  const double now = receiver_.now();
  for (std::size_t i = 0; i < screens_.size(); ++i) {
    const ScreenReport& of = report.screens[i];
    ShownState state = ShownState::Fresh;
    if (!of.arrived || (!of.frame && !failing_)) {
      state = ShownState::Waiting;
    } else if (report.ended) {
      state = ShownState::Ended;
    } else if (now - *of.arrived > settings_.stale_after.count()) {
      state = ShownState::Stale;
    } else if (failing_) {
      state = ShownState::Failed;
    }
    const ShownState before = screens_[i].state;
    if (state == before) continue;
    const std::string& id = wall_.screens[i].id;
    if (state == ShownState::Stale) {
      log::warning("screen {} ({}) is stale: no frame after {}", id, host_, screens_[i].frame);
      show_again(i, with_badge(screens_[i].picture, "stale: frame " + std::to_string(screens_[i].frame)));
    } else if (before == ShownState::Stale) {
      log::info("screen {} ({}) {}, frame {}", id, host_, state == ShownState::Fresh ? "back" : to_string(state),
                screens_[i].frame);
      if (state == ShownState::Ended) show_again(i, screens_[i].picture);
    }
    const std::lock_guard lock(mutex_);
    screens_[i].state = state;
  }
}

void DisplayProcess::show_again(std::size_t screen, const Image<Rgba8>& picture) {
  const std::vector<ScreenPicture> pictures{{screen, picture}};
  (void)try_to_show({screens_[screen].frame, pictures});
}

std::string DisplayProcess::status() const {
  const ReceiverReport report = receiver_.report();
  Json screens = Json::array();
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i < screens_.size(); ++i) {
    const ScreenReport& of = report.screens[i];
    screens.push_back({{"id", wall_.screens[i].id},
                       {"frame", of.frame},
                       {"state", to_string(screens_[i].state)},
                       {"dropped", of.dropped},
                       {"late", of.late},
                       {"skew_ms", of.frame ? Json(of.skew_s * 1000.0) : Json()}});
  }
  const Json document{{"schema", "hpr.display/1"},
                      {"host", host_},
                      {"wall_hash", hex16(wall_.hash)},
                      {"connected", report.connected},
                      {"screens", screens}};
  return document.dump(2) + "\n";
}

void DisplayProcess::write_status() {
  const std::string text = status();
  if (text == written_) return;
  // Whole at any time, and not worth waiting for the disk: it says what is, not what was.
  write_file_atomically(settings_.folder / "display.json", text, AtomicFile::Sync::None);
  written_ = text;
}

}  // namespace hpr
