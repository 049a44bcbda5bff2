#pragma once

#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "core/timing.h"
#include "walls/config/wall.h"
#include "walls/displays/display.h"
#include "walls/link/receiver.h"

namespace hpr {

/// What a display process knows of one of its screens.
enum class ShownState : std::uint8_t {
  Waiting,  ///< no frame yet
  Fresh,
  Stale,   ///< no frame for too long
  Ended,   ///< the run is over; its last frame stays
  Failed,  ///< what came could not be shown: the disk is full
};

[[nodiscard]] std::string_view to_string(ShownState state);

/// `picture` with a badge in its upper left corner that says `label`.
[[nodiscard]] Image<Rgba8> with_badge(const Image<Rgba8>& picture, const std::string& label);

struct ProcessSettings {
  std::filesystem::path folder;  ///< display.json goes here; empty: nowhere
  std::chrono::duration<double> stale_after{1.0};
  bool once = false;  ///< leave when the first run has ended
};

/// Shows what a receiver takes in, and says how each screen fares.
class DisplayProcess {
 public:
  /// `wall`: only this host's screens. All outlive this.
  DisplayProcess(const Wall& wall, std::string host, Display& display, FrameReceiver& receiver,
                 ProcessSettings settings);
  ~DisplayProcess();
  DisplayProcess(const DisplayProcess&) = delete;
  DisplayProcess& operator=(const DisplayProcess&) = delete;

  /// Until `stop` or whoever looks says so, asked several times a second, or with `once` the first run has ended.
  /// Throws what the display throws, but for errors it recovers from: those are said once, and shown is what comes
  /// next, or the same once more every second.
  void run(const std::function<bool()>& stop);

 private:
  void present(Presentation& presentation);
  /// False, and said once, where the display cannot now but may later.
  [[nodiscard]] bool try_to_show(const WallFrame& frame);
  void retry();
  void update(const ReceiverReport& report);
  void show_again(std::size_t screen, const Image<Rgba8>& picture);
  [[nodiscard]] std::string status() const;
  void write_status();

  struct Screen {
    Image<Rgba8> picture;
    std::uint64_t frame = 0;
    ShownState state = ShownState::Waiting;
  };

  const Wall& wall_;
  std::string host_;
  Display& display_;
  FrameReceiver& receiver_;
  ProcessSettings settings_;
  std::vector<Screen> screens_;
  bool failing_ = false;                 ///< the display could not show the last frame
  std::optional<Presentation> unshown_;  ///< that frame
  Stopwatch since_failure_;
  mutable std::mutex mutex_;  ///< of the screens' states
  std::string written_;
  std::mutex waiting_;
  std::condition_variable_any wake_;
  std::jthread writer_;  ///< writing waits for the disk; showing must not
};

}  // namespace hpr
