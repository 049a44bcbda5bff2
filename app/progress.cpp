#include "app/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <utility>

namespace hpr {
namespace {

constexpr std::size_t kBarWidth = 30;

}  // namespace

Progress::Progress(const std::string& mode, std::string what, std::size_t steps)
    : what_(std::move(what)), steps_(steps) {
  const bool terminal = ::isatty(STDERR_FILENO) == 1;
  if (mode == "bar" || (mode == "auto" && terminal && steps != 1)) mode_ = Mode::Bar;
  if (mode == "line") mode_ = Mode::Line;
}

Progress::~Progress() {
  if (mode_ == Mode::Bar && drawn_) std::fputc('\n', stderr);
}

void Progress::show(std::size_t done, const std::string& detail) {
  constexpr double kBetweenDrawings_ms = 50.0;
  done_ = done;
  const std::string count = steps_ == 0 ? fmt::format("{}", done_) : fmt::format("{}/{}", done_, steps_);
  if (mode_ == Mode::Line) fmt::print(stderr, "hpr: {} {} {}\n", what_, count, detail);
  if (mode_ != Mode::Bar) return;
  if (drawn_ && done_ != steps_ && since_drawn_.ms() < kBetweenDrawings_ms) return;
  if (steps_ == 0) {
    fmt::print(stderr, "\r{} {} {}   ", what_, count, detail);
  } else {
    const std::size_t filled = kBarWidth * std::min(done_, steps_) / steps_;
    fmt::print(stderr, "\r{} [{:<{}}] {} {}   ", what_, std::string(filled, '#'), kBarWidth, count, detail);
  }
  std::fflush(stderr);
  drawn_ = true;
  since_drawn_.restart();
}

}  // namespace hpr
