#pragma once

#include <string>

namespace hpr {

/// The machine a figure was measured on, as reports name it.
struct Machine {
  std::string cpu;  ///< model name; "unknown" where the system does not say
  int cores = 1;    ///< job_cores()
  std::string mpi;  ///< library and version
};
[[nodiscard]] Machine this_machine();

/// The cores of this machine that this process may use or, in an MPI job, its ranks together: a launcher may bind each
/// to cores of its own.
[[nodiscard]] int job_cores();

}  // namespace hpr
