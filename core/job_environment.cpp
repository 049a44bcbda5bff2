#include "core/job_environment.h"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cstdlib>

// NOLINTBEGIN(concurrency-mt-unsafe): nobody writes the environment
namespace hpr {

int launched_rank() {
  for (const char* const name : {"OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"}) {
    if (const char* const value = std::getenv(name); value != nullptr) return std::atoi(value);
  }
  return 0;
}

bool inside_mpi_job() {
  for (const char* const name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMI_RANK", "PMIX_RANK"}) {
    if (std::getenv(name) != nullptr) return true;
  }
  return false;
}

bool launched_by_hpr() {
  return inside_mpi_job() && std::getenv(kReportStartVariable) != nullptr;
}

bool input_is_typed() {
  return ::isatty(STDIN_FILENO) == 1 || std::getenv(kTypedInputVariable) != nullptr;
}

bool stderr_is_terminal() {
  return ::isatty(STDERR_FILENO) == 1 || (inside_mpi_job() && std::getenv(kTerminalVariable) != nullptr);
}

std::string host_name() {
  std::array<char, 256> name{};
  ::gethostname(name.data(), name.size() - 1);
  return name.data();
}

std::string said_by(int rank) {
  return rank == 0 ? "" : fmt::format("rank {} on {}: ", rank, host_name());
}

}  // namespace hpr
// NOLINTEND(concurrency-mt-unsafe)
