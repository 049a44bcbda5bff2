#pragma once

#include <cstddef>
#include <string>

namespace hpr {

/// Tells on stderr how far long work has come: a bar that redraws itself on a terminal, a line per step, or nothing.
class Progress {
 public:
  /// `mode`: auto (a bar on a terminal, else nothing), bar, line or none. `what` names a step: "frame".
  Progress(const std::string& mode, std::string what, std::size_t steps);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void step(const std::string& detail);

 private:
  enum class Mode { None, Bar, Line };

  Mode mode_ = Mode::None;
  std::string what_;
  std::size_t steps_;
  std::size_t done_ = 0;
};

}  // namespace hpr
