#pragma once

#include <chrono>
#include <cstddef>
#include <string>

#include "core/timing.h"

namespace hpr {

/// Reports on stderr how far long work has come: a bar that redraws itself on a terminal, a line per step, or nothing.
class Progress {
 public:
  /// How often work that may take hours is reported.
  struct Pace {
    std::chrono::duration<double> terminal{1.0};
    std::chrono::duration<double> log{10.0};
  };

  /// `mode`: auto (a bar on a terminal, else nothing), bar, line or none. `what` names a step: "frame". `steps`: 0 when
  /// nobody knows how many.
  Progress(const std::string& mode, std::string what, std::size_t steps);
  /// Reports at the rate of `pace`: how often the bar is redrawn and, where stderr is no terminal, how often `auto`
  /// writes a line.
  Progress(const std::string& mode, std::string what, std::size_t steps, const Pace& pace);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void step(const std::string& detail) { show(done_ + 1, detail); }
  /// False: nothing is ever reported.
  [[nodiscard]] bool enabled() const { return mode_ != Mode::None; }
  /// Whether show(done) would report: otherwise the description of a step need not be made.
  [[nodiscard]] bool due(std::size_t done) const;
  /// `done` steps in all are done. A bar is redrawn at most every 50 ms, but for the last step.
  void show(std::size_t done, const std::string& detail);
  /// Leaves the bar as it stands: what is written next has a line of its own.
  void end();

 private:
  enum class Mode { None, Bar, Line, Log };

  Mode mode_ = Mode::None;
  std::string what_;
  std::size_t steps_;
  std::size_t done_ = 0;
  Pace pace_{std::chrono::milliseconds(50), std::chrono::seconds(10)};
  Stopwatch since_drawn_;
  bool drawn_ = false;
  std::size_t length_ = 0;  ///< of the bar as it is drawn
};

}  // namespace hpr
