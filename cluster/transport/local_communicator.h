#pragma once

#include <chrono>
#include <cstdint>
#include <functional>

#include "cluster/transport/communicator.h"

namespace hpr {

/// Runs `body` once per rank, each on a thread of this process, and returns when all are done. When a rank fails its
/// peers' waits end; rethrows the first failure. Lets everything above be tested, and run, without MPI.
void run_local_ranks(int size, const std::function<void(Communicator&)>& body,
                     std::chrono::nanoseconds hang_timeout = kHangTimeout);

/// How ranks of one process are to behave.
struct LocalRanks {
  int size = 1;
  std::chrono::nanoseconds hang_timeout = kHangTimeout;
  int ranks_per_host = 0;      ///< makes ranks [n k, n (k + 1)) a host that shares memory; 0: all of them
  std::uint64_t disorder = 0;  ///< seed of random delays and orders of arrival; 0: none
  /// A rank whose messages arrive as no network may let them, each frame's first before the last of the frame before;
  /// -1: none.
  int overtaking = -1;
};
void run_local_ranks(const LocalRanks& ranks, const std::function<void(Communicator&)>& body);

}  // namespace hpr
