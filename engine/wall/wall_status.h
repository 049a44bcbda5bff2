#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "core/progress.h"
#include "engine/frame_maker.h"
#include "engine/wall/slow_ranks.h"
#include "walls/manifest/manifest.h"

namespace hpr {

/// Collective. What each rank did for the last of `frames`.
[[nodiscard]] std::vector<RankWork> works_of(Session& session, const FrameMaker& frames);

/// The name of RankWork::pass.
[[nodiscard]] std::string pass_name(const FrameMaker& frames, std::size_t pass);

/// The rank that did most for the last of `frames`. `works` and `hosts`: per rank.
[[nodiscard]] SlowestRecord slowest_of(std::span<const RankWork> works, const FrameMaker& frames,
                                       std::span<const std::string> hosts);

/// As manifests have it.
[[nodiscard]] BudgetRecord to_record(const BudgetReport& report);
[[nodiscard]] VerifyRecord to_record(const VerifyReport& report);

/// "24.1 fps (min 11.0), slowest rank 3 on wall05: shadow 21.0 ms; stale: wall-r0c1": the frames that took `frame_ms`
/// each, what the last of them was held up by, and what its screens show; `states` per screen of `last`.
[[nodiscard]] std::string describe_status(std::span<const double> frame_ms, const FrameRecord& last,
                                          std::span<const ScreenState> states);

/// Reports on stderr how a wall's run proceeds: a line that redraws itself once a second on a terminal, a line every
/// ten seconds in a log.
class WallStatus {
 public:
  /// `mode`: as Progress has it. `done` of `frames` are done already; 0: nobody knows how many there will be.
  WallStatus(const std::string& mode, std::size_t done, std::size_t frames)
      : progress_(mode, "frame", frames, Progress::Pace{}), done_(done) {}

  /// After every frame; `states()` is called where a line is due.
  template <typename States>
  void add(double ms, const FrameRecord& frame, const States& states) {
    ++done_;
    if (!progress_.enabled()) return;
    frame_ms_.push_back(ms);
    if (!progress_.due(done_)) return;
    progress_.show(done_, describe_status(frame_ms_, frame, states()));
    frame_ms_.clear();
  }

 private:
  Progress progress_;
  std::size_t done_;
  std::vector<double> frame_ms_;  ///< since the last line
};

}  // namespace hpr
