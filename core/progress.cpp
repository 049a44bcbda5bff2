#include "core/progress.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <utility>

#include "core/job_environment.h"

namespace hpr {
namespace {

constexpr std::size_t kBarWidth = 30;

}  // namespace

Progress::Progress(const std::string& mode, std::string what, std::size_t steps)
    : what_(std::move(what)), steps_(steps) {
  const bool terminal = stderr_is_terminal();
  if (mode == "bar" || (mode == "auto" && terminal && steps != 1)) mode_ = Mode::Bar;
  if (mode == "line") mode_ = Mode::Line;
}

Progress::Progress(const std::string& mode, std::string what, std::size_t steps, const Pace& pace)
    : Progress(mode, std::move(what), steps) {
  pace_ = pace;
  if (mode == "auto" && mode_ == Mode::None && !stderr_is_terminal()) mode_ = Mode::Log;
}

Progress::~Progress() {
  end();
}

void Progress::end() {
  if (mode_ == Mode::Bar && drawn_) std::fputc('\n', stderr);
  drawn_ = false;
  length_ = 0;
}

bool Progress::due(std::size_t done) const {
  const auto passed = [&](std::chrono::duration<double> pace) { return since_drawn_.ms() >= 1000.0 * pace.count(); };
  switch (mode_) {
    case Mode::None:
      return false;
    case Mode::Bar:
      return !drawn_ || done == steps_ || passed(pace_.terminal);
    case Mode::Line:
      return true;
    case Mode::Log:
      break;
  }
  return passed(pace_.log);
}

void Progress::show(std::size_t done, const std::string& detail) {
  done_ = done;
  if (!due(done)) return;
  const std::string count = steps_ == 0 ? fmt::format("{}", done_) : fmt::format("{}/{}", done_, steps_);
  since_drawn_.restart();
  if (mode_ != Mode::Bar) {
    fmt::print(stderr, "hpr: {} {} {}\n", what_, count, detail);
    return;
  }
  std::string line = fmt::format("{} {} {}", what_, count, detail);
  if (steps_ > 0) {
    const std::size_t filled = kBarWidth * std::min(done_, steps_) / steps_;
    line = fmt::format("{} [{:<{}}] {} {}", what_, std::string(filled, '#'), kBarWidth, count, detail);
  }
  fmt::print(stderr, "\r{:<{}}", line, std::max(line.size(), length_));
  length_ = line.size();
  std::fflush(stderr);
  drawn_ = true;
}

}  // namespace hpr
