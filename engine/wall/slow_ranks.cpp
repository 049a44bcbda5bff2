#include "engine/wall/slow_ranks.h"

#include <fmt/format.h>

#include <algorithm>

namespace hpr {
namespace {

constexpr double kSlowRatio = 4.0;
constexpr double kSlowMs = 50.0;
constexpr int kSlowFrames = 10;
constexpr double kSlowSeconds = 5.0;
constexpr double kBetweenReports_s = 60.0;

/// The upper of two where their number is even: of three ranks an idle one makes the others no slower.
double median_of_others(std::span<const RankWork> works, std::size_t rank) {
  std::vector<double> others;
  for (std::size_t other = 0; other < works.size(); ++other) {
    if (other != rank) others.push_back(works[other].ms);
  }
  const auto median = others.begin() + static_cast<std::ptrdiff_t>(others.size() / 2);
  std::ranges::nth_element(others, median);
  return *median;
}

}  // namespace

std::string describe(const SlowRank& slow, const std::string& host, const std::string& pass) {
  return fmt::format("rank {} on {} {} {:.1f} times slower than the others for {:.0f} s{}, in {}", slow.rank, host,
                     slow.is_over ? "was" : "is", slow.ratio, slow.seconds, slow.is_over ? "" : " so far", pass);
}

std::vector<SlowRank> SlowRankWatch::add(std::span<const RankWork> works, double now_s) {
  std::vector<SlowRank> reports;
  ranks_.resize(works.size());
  if (works.size() < 2) return reports;
  for (std::size_t i = 0; i < works.size(); ++i) {
    const double others_ms = median_of_others(works, i);
    const double ms = works[i].ms;
    Rank& rank = ranks_[i];
    Streak& streak = rank.streak;
    const auto report = [&](bool is_over) {
      // A rank of others that do next to nothing would be infinitely slower.
      constexpr double kMinOthersMs = 0.1;
      const double ratio = streak.ms / std::max(streak.others_ms, kMinOthersMs * streak.frames);
      reports.push_back({static_cast<int>(i), ratio, streak.last_s - streak.since_s, streak.pass, is_over});
    };
    if (ms <= kSlowRatio * others_ms || ms <= others_ms + kSlowMs) {
      if (streak.is_reported) report(true);
      streak = {};
      continue;
    }
    if (streak.frames == 0) streak.since_s = now_s - 1e-3 * ms;
    ++streak.frames;
    streak.last_s = now_s;
    streak.ms += ms;
    streak.others_ms += others_ms;
    streak.pass = works[i].pass;
    const bool is_long = streak.frames >= kSlowFrames || now_s - streak.since_s >= kSlowSeconds;
    const bool is_due = !rank.reported_s || now_s - *rank.reported_s >= kBetweenReports_s;
    if (!is_long || !is_due) continue;
    rank.reported_s = now_s;
    streak.is_reported = true;
    report(false);
  }
  return reports;
}

}  // namespace hpr
