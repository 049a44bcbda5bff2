#pragma once

#include <chrono>
#include <cstddef>
#include <deque>
#include <functional>

#include "app/launch/launcher.h"
#include "app/options/globals.h"
#include "cluster/transport/communicator.h"
#include "core/error.h"

namespace hpr {

/// Runs `body` on `globals.ranks` ranks. Inside an MPI job (mpirun, srun, or our own mpiexec) the job's ranks run it;
/// with one rank it runs here; otherwise mpiexec is started with this very command line and the body never runs here.
/// Returns what all ranks agreed on. Check whatever can be checked without the other ranks before calling it.
[[nodiscard]] ExitCode run_ranks(const Globals& globals, const std::function<ExitCode(Communicator&)>& body,
                                 const JobOptions& options = {});

/// How often a run may still be started again: `count` times in any `period`. A wall that runs for a month outlives a
/// loss a week; one that loses ranks all the time ends.
class RestartLimit {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::hours kPeriod{1};

  explicit RestartLimit(int count, Clock::duration period = kPeriod) : count_(count), period_(period) {}

  /// Uses one; false where none is left. `now` never goes back.
  [[nodiscard]] bool use(Clock::time_point now);
  /// How many were used in the period that ends with the last use().
  [[nodiscard]] std::size_t used() const { return uses_.size(); }

 private:
  int count_;
  Clock::duration period_;
  std::deque<Clock::time_point> uses_;
};

/// As run_ranks; where that starts a job of several ranks, one that loses a rank or stands still is started again, up
/// to `restarts` times an hour (RestartLimit), with the journal of what was done. It is not where the frame after which
/// it ended is the one an earlier job ended at: that frame would end the next one too. Throws Error (Lost) then.
[[nodiscard]] ExitCode run_supervised(const Globals& globals, int restarts, Interrupts interrupts,
                                      const std::function<ExitCode(Communicator&)>& body);

}  // namespace hpr
