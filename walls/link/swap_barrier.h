#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "walls/manifest/manifest.h"

namespace hpr {

/// A display is to show a frame now.
struct SwapDecision {
  std::size_t display = 0;
  std::uint64_t frame = 0;
  bool late = false;  ///< the others show it already
};

/// Something about a display that its user wants to read once.
struct SwapEvent {
  enum class Kind : std::uint8_t { Lost, Stale, Failed, Back };
  Kind kind = Kind::Lost;
  std::size_t display = 0;
  std::uint64_t frame = 0;
};

/// What became of a frame.
struct SwapOutcome {
  std::vector<ScreenState> screens;
  std::optional<double> skew_s;  ///< between the first and the last display that showed it; none: fewer than two did
};

/// Decides when the displays of a wall show a frame: together, once all are ready for it, or when those that are have
/// waited long enough. Who misses a frame is not waited for again until it has caught up. Knows neither sockets nor
/// threads; times are seconds of one clock, and never run backwards.
class SwapBarrier {
 public:
  /// `display_of`: per screen. All displays are gone until they connect.
  SwapBarrier(const std::vector<std::size_t>& display_of, std::size_t displays, double timeout_s);

  void connected(std::size_t display, double now);
  void gone(std::size_t display, double now);
  /// Frame by frame, numbers ascending: the job has sent it, or tried to.
  void post(std::uint64_t frame, double now);
  void ready(std::size_t screen, std::uint64_t frame, double now);
  void shown(std::size_t display, std::uint64_t frame, double at);
  /// The display is there and has the frame, but cannot put it on its screens.
  void not_shown(std::size_t display, std::uint64_t frame, double now);

  /// What is to be shown now; each is returned once.
  [[nodiscard]] std::vector<SwapDecision> due(double now);
  /// When due() may have something without further news.
  [[nodiscard]] std::optional<double> next_due() const;

  /// The frame posted last.
  [[nodiscard]] std::optional<std::uint64_t> newest() const { return posted_; }
  /// Whether all displays that are there and keep up are ready for this frame or a later one.
  [[nodiscard]] bool all_ready(std::uint64_t frame) const;
  /// Whether all those have shown it.
  [[nodiscard]] bool all_shown(std::uint64_t frame) const;
  /// Nobody waits any longer for those that are not ready for it.
  void give_up(std::uint64_t frame, double now);

  /// The outcome of a frame that was posted and not forgotten.
  [[nodiscard]] SwapOutcome outcome(std::uint64_t frame) const;
  /// Forgets frames before this one, also those that nobody showed.
  void forget_before(std::uint64_t frame);
  /// How long something was missing on the wall since the first frame.
  [[nodiscard]] double degraded_seconds(double now) const;
  [[nodiscard]] std::vector<SwapEvent> take_events();

 private:
  struct Display {
    bool up = false;
    bool late = false;                   ///< missed a frame and has not caught up
    std::optional<double> late_since{};  ///< cleared when caught up
    bool reported_lost = false;
    bool reported_stale = false;
    bool failing = false;  ///< could not show its last frame
  };
  struct Screen {
    std::size_t display = 0;
    std::set<std::uint64_t> ready;  ///< of the last few frames
  };
  struct Frame {
    std::optional<double> first_ready;
    bool presented = false;
    std::vector<ScreenState> screens;
    std::vector<std::optional<double>> shown;  ///< per display
    std::vector<bool> failed;                  ///< per display: said that it could not be shown
  };

  /// Frames before it were shown, or are older than what any display still holds.
  [[nodiscard]] std::uint64_t oldest_undecided() const;
  [[nodiscard]] bool is_ready(std::size_t display, std::uint64_t frame) const;
  [[nodiscard]] bool has_frame(std::size_t display, std::uint64_t frame) const;
  /// Who has begun to take in a frame counts as keeping up with it.
  [[nodiscard]] bool waited_for(std::size_t display, std::uint64_t frame) const;
  void present(std::uint64_t frame, double now, std::vector<SwapDecision>& decisions);
  void fall_behind(std::size_t display, double now);
  void catch_up(std::size_t display, double now);
  void count_degraded(double now);

  std::vector<Display> displays_;
  std::vector<Screen> screens_;
  double timeout_s_;
  std::map<std::uint64_t, Frame> frames_;
  std::optional<std::uint64_t> posted_;
  std::optional<std::uint64_t> presented_;
  std::vector<SwapDecision> late_decisions_;
  std::vector<SwapEvent> events_;
  std::optional<double> degraded_since_;
  double degraded_s_ = 0.0;
};

}  // namespace hpr
