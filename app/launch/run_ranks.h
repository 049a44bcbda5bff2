#pragma once

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

/// As run_ranks; where that starts a job of several ranks, one that loses a rank or stands still is started again, up
/// to `restarts` times, with the journal of what was done. It is not where the frame after which it ended is the one an
/// earlier job ended at: that frame would end the next one too. Throws Error (Lost) then.
[[nodiscard]] ExitCode run_supervised(const Globals& globals, int restarts, Interrupts interrupts,
                                      const std::function<ExitCode(Communicator&)>& body);

}  // namespace hpr
