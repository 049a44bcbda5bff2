#pragma once

#include <atomic>
#include <functional>
#include <mutex>

#include "core/timing.h"

namespace hpr {

/// Whether a picture that is being drawn has been overtaken: its viewer moves on, or the run is to end. Each rank has
/// one that knows of its own viewers; ranks agree on it between a few tiles.
class Interrupt {
 public:
  /// `poll`: whether anything has come; never waits. Called by whatever thread draws, by one at a time.
  explicit Interrupt(std::function<bool()> poll) : poll_(std::move(poll)) {}

  /// From any thread, as often as one likes: polls every few milliseconds, and stays true.
  [[nodiscard]] bool is_raised();

 private:
  std::function<bool()> poll_;
  std::mutex mutex_;
  Stopwatch since_poll_;
  bool has_polled_ = false;
  std::atomic<bool> raised_ = false;
};

}  // namespace hpr
