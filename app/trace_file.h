#pragma once

#include <functional>

#include "app/options/globals.h"
#include "cluster/transport/communicator.h"
#include "core/error.h"

namespace hpr {

/// Before any work: throws Error (Io) where globals.trace cannot be written or exists (without --force or --resume),
/// and (Usage) where it holds something else than a trace, which none shall replace.
void check_trace(const Globals& globals);

/// Collective: does `body` and writes what all ranks did meanwhile to globals.trace, if that is set, in Chrome's trace
/// event format (as chrome://tracing, Perfetto and Speedscope read it): one process per rank, one row per thread,
/// microseconds since the ranks met. Clocks of other hosts are set by that meeting, to within its messages' time.
/// Throws Error (Io), (Usage) where `body` wrote that file, and what `body` does; then nothing is written.
ExitCode traced(Communicator& comm, const Globals& globals, const std::function<ExitCode(Communicator&)>& body);

/// The same of a command that has no job of ranks.
ExitCode traced_alone(const Globals& globals, const std::function<ExitCode()>& body);

}  // namespace hpr
