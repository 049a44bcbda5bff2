#pragma once

#include <chrono>
#include <cstddef>
#include <deque>
#include <filesystem>
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

/// Whether this process is to start ranks, or a lone one, and start them again when they are lost.
[[nodiscard]] bool supervises(int restarts);

/// Whether run_supervised() draws in other processes, which report what they find themselves.
[[nodiscard]] bool starts_ranks(const Globals& globals, int restarts);

/// Whether this is a job of a run that lost an earlier one, which may have written what is to be written again.
[[nodiscard]] bool is_started_again();

/// As run_ranks, but where this process supervises() the ranks are processes of their own, also a lone one: a job that
/// loses a rank or stands still is started again, up to `restarts` times an hour (RestartLimit), with the journal of
/// what was done. Under a launcher that takes rank 0 to another host the journal is in `folder`, which all hosts see.
/// It is not where two jobs that drew ended at the same frame of a run that knows its last one: that frame would end
/// the next one too. Throws Error (Lost) then.
[[nodiscard]] ExitCode run_supervised(const Globals& globals, int restarts, Interrupts interrupts,
                                      const std::filesystem::path& folder,
                                      const std::function<ExitCode(Communicator&)>& body);

}  // namespace hpr
