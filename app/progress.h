#pragma once

#include <cstddef>
#include <string>

#include "core/stopwatch.h"

namespace hpr {

/// Tells on stderr how far long work has come: a bar that redraws itself on a terminal, a line per step, or nothing.
class Progress {
 public:
  /// `mode`: auto (a bar on a terminal, else nothing), bar, line or none. `what` names a step: "frame". `steps`: 0 when
  /// nobody knows how many.
  Progress(const std::string& mode, std::string what, std::size_t steps);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void step(const std::string& detail) { show(done_ + 1, detail); }
  /// `done` steps in all are done. A bar is redrawn at most every 50 ms, but for the last step.
  void show(std::size_t done, const std::string& detail);

 private:
  enum class Mode { None, Bar, Line };

  Mode mode_ = Mode::None;
  std::string what_;
  std::size_t steps_;
  std::size_t done_ = 0;
  Stopwatch since_drawn_;
  bool drawn_ = false;
};

}  // namespace hpr
