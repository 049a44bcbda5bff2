#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "walls/config/wall.h"
#include "walls/displays/display.h"
#include "walls/link/receiver.h"

namespace hpr {

/// What a display process knows of one of its screens.
enum class ShownState : std::uint8_t {
  Waiting,  ///< no frame yet
  Fresh,
  Stale,  ///< no frame for too long
  Ended,  ///< the run is over; its last frame stays
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
  /// Throws what the display throws.
  void run(const std::function<bool()>& stop);

 private:
  void present(Presentation& presentation);
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
  mutable std::mutex mutex_;  ///< of the screens' states
  std::string written_;
  std::jthread writer_;  ///< writing waits for the disk; showing must not
};

}  // namespace hpr
