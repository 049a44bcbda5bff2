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

}  // namespace hpr
