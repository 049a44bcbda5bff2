#pragma once

#include <vector>

#include "cluster/transport/communicator.h"
#include "tools/bench/bench_rows.h"

namespace hpr {

/// What messages and merging cost on this machine. Collective over two or more ranks of an MPI job; the rows stand on
/// rank 0. Its first row, a copy of 64 MiB by one thread, beside the 4.5 ms it took where the compositing times of IceT
/// in docs/measurements.md were measured, scales those to this machine. Takes about a second.
[[nodiscard]] std::vector<BenchRow> bench_net(Communicator& comm);

}  // namespace hpr
