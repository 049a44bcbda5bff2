#include "app/launch/rank_watch.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <utility>

namespace hpr {

RankWatch::RankWatch(const JobBoard& board) : board_(board), ranks_(static_cast<std::size_t>(board.ranks())) {}

RankWatch::~RankWatch() {
  for (const Rank& rank : ranks_) {
    if (rank.process >= 0) ::close(rank.process);
  }
}

void RankWatch::update(std::chrono::nanoseconds passed) {
  bool moved = false;
  for (std::size_t i = 0; i < ranks_.size(); ++i) {
    Rank& rank = ranks_[i];
    std::optional<RankReport> report = board_.read(static_cast<int>(i));
    if (!report) continue;
    const bool is_new = !rank.report;
    moved = moved || is_new || report->steps != rank.report->steps;
    rank.report = std::move(report);
    if (!is_new) continue;
    rank.process = static_cast<int>(::syscall(SYS_pidfd_open, rank.report->process, 0));
    if (rank.process < 0 && errno == ESRCH && first_.empty()) first_.push_back(static_cast<int>(i));
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
  return knows_all() ? first_known_to_end() : std::nullopt;
}

std::optional<std::string> RankWatch::first_known_to_end() const {
  if (first_.empty()) return std::nullopt;
  std::vector<std::string> all;
  for (const int rank : first_) {
    // What it reported after the last update() is still there.
    all.push_back(describe(rank, board_.read(rank).value_or(RankReport{})));
  }
  return fmt::format("{}", fmt::join(all, ", or "));
}

bool RankWatch::knows_all() const {
  return std::ranges::all_of(ranks_, [](const Rank& rank) { return rank.report.has_value(); });
}

std::chrono::nanoseconds RankWatch::stall_limit() const {
  // Ranks of this host wait for those of others without getting on.
  constexpr std::chrono::seconds kOfOtherHosts{60};
  std::chrono::nanoseconds limit{0};
  for (const Rank& rank : ranks_) {
    if (rank.report) limit = std::max(limit, rank.report->stall_limit);
  }
  if (limit == std::chrono::nanoseconds::zero() || knows_all()) return limit;
  return std::max<std::chrono::nanoseconds>(limit, kOfOtherHosts);
}

bool RankWatch::stalled() const {
  return stall_limit() > std::chrono::nanoseconds::zero() && still_ > stall_limit();
}

std::string RankWatch::roll_call() const {
  constexpr std::size_t kMaxNamed = 8;
  std::vector<std::string> awaited;
  std::vector<std::string> waiting;
  for (int rank = 0; rank < board_.ranks(); ++rank) {
    if (const auto report = board_.read(rank))
      (report->awaited_rank ? waiting : awaited).push_back(describe(rank, *report));
  }
  std::vector<std::string> all = std::move(awaited);
  all.insert(all.end(), waiting.begin(), waiting.end());
  const std::size_t count = all.size();
  all.resize(std::min(count, kMaxNamed));
  if (count > kMaxNamed) all.push_back(fmt::format("and {} more", count - kMaxNamed));
  return fmt::format("{}", fmt::join(all, "; "));
}

}  // namespace hpr
