#include "engine/wall/wall_status.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>

#include "cluster/transport/collectives.h"
#include "engine/session.h"

namespace hpr {
namespace {

/// What it took to composite is left out: most of that is waiting.
RankWork work_of(const FrameTimes& times, const FrameTimes& before, int threads) {
  const double primary_ms = times.primary_ms - before.primary_ms;
  RankWork work{primary_ms, primary_ms, 0};
  for (std::size_t i = 0; i < times.passes.size(); ++i) {
    const double earlier_ms = i < before.passes.size() ? before.passes[i].ms : 0.0;
    const double ms = (times.passes[i].ms - earlier_ms) / threads;
    work.ms += ms;
    if (ms > work.pass_ms) work = {work.ms, ms, i + 1};
  }
  return work;
}

/// "; stale: a, b" for the screens in that state; a few of them by name.
std::string screens_in(ScreenState state, const FrameRecord& frame, std::span<const ScreenState> states) {
  constexpr std::size_t kMaxNames = 4;
  std::string text;
  std::size_t count = 0;
  for (std::size_t i = 0; i < states.size(); ++i) {
    if (states[i] != state) continue;
    if (count < kMaxNames) text += fmt::format("{}{}", count == 0 ? "" : ", ", frame.screens.at(i).id);
    ++count;
  }
  if (count == 0) return "";
  if (count > kMaxNames) text += fmt::format(" and {} more", count - kMaxNames);
  return fmt::format("; {}: {}", to_string(state), text);
}

}  // namespace

std::vector<RankWork> works_of(Session& session, const FrameMaker& frames) {
  return all_gather_value(session.comm(), work_of(frames.times(), frames.times_before(), session.threads()));
}

std::string pass_name(const FrameMaker& frames, std::size_t pass) {
  if (pass > 0) return frames.times().passes.at(pass - 1).name;
  return frames.plan().primary == Primary::Rays ? "primary-rays" : "raster";
}

SlowestRecord slowest_of(std::span<const RankWork> works, const FrameMaker& frames,
                         std::span<const std::string> hosts) {
  const auto most = std::ranges::max_element(works, {}, &RankWork::ms);
  const auto rank = static_cast<std::size_t>(most - works.begin());
  return {static_cast<int>(rank), hosts[rank], most->ms, pass_name(frames, most->pass), most->pass_ms};
}

BudgetRecord to_record(const BudgetReport& report) {
  return {report.target_ms, report.resolution_scale, report.samples, report.given_up, report.resting};
}

VerifyRecord to_record(const VerifyReport& report) {
  return {report.percent, report.counts.tiles, report.counts.mismatches};
}

std::string describe_status(std::span<const double> frame_ms, const FrameRecord& last,
                            std::span<const ScreenState> states) {
  std::vector<double> sorted(frame_ms.begin(), frame_ms.end());
  std::ranges::sort(sorted);
  const auto per_second = [](double ms) { return 1000.0 / std::max(ms, 1e-3); };
  std::string text = fmt::format("{:.1f} fps", per_second(sorted.at((sorted.size() - 1) / 2)));
  if (sorted.size() > 1) text += fmt::format(" (min {:.1f})", per_second(sorted.back()));
  if (last.slowest) {
    text += fmt::format(", slowest rank {} on {}: {} {:.1f} ms", last.slowest->rank, last.slowest->host,
                        last.slowest->pass, last.slowest->pass_ms);
  }
  return text + screens_in(ScreenState::Stale, last, states) + screens_in(ScreenState::Lost, last, states);
}

}  // namespace hpr
