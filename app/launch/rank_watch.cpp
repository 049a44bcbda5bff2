#include "app/launch/rank_watch.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

namespace hpr {

RankWatch::RankWatch(const JobBoard& board) : board_(board), ranks_(static_cast<std::size_t>(board.ranks())) {}

RankWatch::~RankWatch() {
  for (const Rank& rank : ranks_) {
    if (rank.process >= 0) ::close(rank.process);
  }
}

void RankWatch::look(std::chrono::nanoseconds passed) {
  bool moved = false;
  for (std::size_t i = 0; i < ranks_.size(); ++i) {
    Rank& rank = ranks_[i];
    std::optional<RankReport> report = board_.read(static_cast<int>(i));
    if (!report) continue;
    const bool is_new = !rank.report;
    moved = moved || is_new || report->steps != rank.report->steps;
    rank.report = std::move(report);
    if (is_new) rank.process = static_cast<int>(::syscall(SYS_pidfd_open, rank.report->process, 0));
  }
  still_ = moved ? std::chrono::nanoseconds::zero() : still_ + passed;
}

void RankWatch::add_to(std::vector<pollfd>& waited) const {
  for (const Rank& rank : ranks_) {
    if (rank.process >= 0) waited.push_back({.fd = rank.process, .events = POLLIN, .revents = 0});
  }
}

void RankWatch::note_ends(const std::vector<pollfd>& waited) {
  std::vector<int> ended;
  for (const pollfd& each : waited) {
    if (each.revents == 0) continue;
    const auto rank = std::ranges::find(ranks_, each.fd, &Rank::process);
    if (rank == ranks_.end()) continue;
    ::close(std::exchange(rank->process, -1));
    ended.push_back(static_cast<int>(rank - ranks_.begin()));
  }
  if (first_.empty()) first_ = std::move(ended);
}

std::optional<std::string> RankWatch::first_to_end() const {
  if (first_.empty()) return std::nullopt;
  std::vector<std::string> all;
  for (const int rank : first_) {
    // What it reported after the last look is still there.
    all.push_back(describe(rank, board_.read(rank).value_or(RankReport{})));
  }
  return fmt::format("{}", fmt::join(all, ", or "));
}

std::chrono::nanoseconds RankWatch::stall_limit() const {
  std::chrono::nanoseconds limit{0};
  for (const Rank& rank : ranks_) {
    if (rank.report) limit = std::max(limit, rank.report->stall_limit);
  }
  return limit;
}

bool RankWatch::stalled() const {
  return stall_limit() > std::chrono::nanoseconds::zero() && still_ > stall_limit();
}

std::string RankWatch::roll_call() const {
  std::vector<std::string> all;
  for (int rank = 0; rank < board_.ranks(); ++rank) {
    if (const auto report = board_.read(rank)) all.push_back(describe(rank, *report));
  }
  return fmt::format("{}", fmt::join(all, "; "));
}

}  // namespace hpr
