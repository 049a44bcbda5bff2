#pragma once

#include <functional>

#include "cluster/communicator.h"

namespace hpr {

/// Runs `body` once per rank, each on a thread of this process, and returns when all are done. When a rank fails its
/// peers' waits end; rethrows the first failure. Lets everything above be tested, and run, without MPI.
void run_local_ranks(int size, const std::function<void(Communicator&)>& body,
                     std::chrono::nanoseconds hang_timeout = kHangTimeout);

}  // namespace hpr
