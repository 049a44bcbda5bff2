#pragma once

#include <mpi.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "core/peer_memory.h"

namespace hpr {

/// Where Open MPI keeps shared windows. More than it has room for would end in a bus error when first touched.
inline constexpr const char* kSharedMemoryFolder = "/dev/shm";

/// Bytes left there; as many as can be counted where windows live elsewhere.
[[nodiscard]] std::uint64_t free_shared_memory();

/// Collective over `comm`: `bytes` zeroed bytes for each rank in one MPI-3 shared window per host. Whoever reads what
/// another rank was given waits for all ranks to have returned. Throws Error (Limit) when MPI cannot allocate it. A
/// meeting lasts `hang_timeout` at most.
[[nodiscard]] std::shared_ptr<PeerMemory> make_window_memory(MPI_Comm comm, std::size_t bytes,
                                                             std::chrono::nanoseconds hang_timeout);

}  // namespace hpr
