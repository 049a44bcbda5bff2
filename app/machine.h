#pragma once

#include <string>

namespace hpr {

/// The machine a figure was measured on, as reports name it.
struct Machine {
  std::string cpu;  ///< model name; "unknown" where the system does not say
  int cores = 1;    ///< this process may use
  std::string mpi;  ///< library and version
};
[[nodiscard]] Machine this_machine();

}  // namespace hpr
