#include "app/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <utility>

namespace hpr {
namespace {

constexpr std::size_t kBarWidth = 30;

}  // namespace

Progress::Progress(const std::string& mode, std::string what, std::size_t steps)
    : what_(std::move(what)), steps_(steps) {
  const bool terminal = ::isatty(STDERR_FILENO) == 1;
  if (mode == "bar" || (mode == "auto" && terminal && steps > 1)) mode_ = Mode::Bar;
  if (mode == "line") mode_ = Mode::Line;
}

Progress::~Progress() {
  if (mode_ == Mode::Bar && done_ > 0) std::fputc('\n', stderr);
}

void Progress::step(const std::string& detail) {
  ++done_;
  if (mode_ == Mode::Line) fmt::print(stderr, "hpr: {} {}/{} {}\n", what_, done_, steps_, detail);
  if (mode_ != Mode::Bar) return;
  const std::size_t filled = kBarWidth * done_ / steps_;
  fmt::print(stderr, "\r{} [{:<{}}] {}/{} {} ", what_, std::string(filled, '#'), kBarWidth, done_, steps_, detail);
  std::fflush(stderr);
}

}  // namespace hpr
