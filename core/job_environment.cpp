#include "core/job_environment.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>

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

int srun_tasks() {
  // A batch script has the allocation's number of tasks, too, but is no step of it.
  const char* tasks = std::getenv("SLURM_STEP_NUM_TASKS");
  if (tasks == nullptr && std::getenv("SLURM_STEP_ID") != nullptr) tasks = std::getenv("SLURM_NTASKS");
  return tasks == nullptr ? 1 : std::max(std::atoi(tasks), 1);
}

bool is_one_host() {
  constexpr std::array<const char*, 8> kHosts{"SLURM_JOB_ID",
                                              "SLURM_JOBID",
                                              "PBS_JOBID",
                                              "LSB_JOBID",
                                              "PE_HOSTFILE",
                                              "COBALT_JOBID",
                                              "OMPI_MCA_orte_default_hostfile",
                                              "OMPI_MCA_orte_rankfile"};
  if (std::ranges::any_of(kHosts, [](const char* name) { return std::getenv(name) != nullptr; })) return false;
  std::ifstream hosts("/etc/openmpi/openmpi-default-hostfile");
  for (std::string line; std::getline(hosts, line);) {
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first != std::string::npos && line[first] != '#') return false;
  }
  return true;
}

bool launched_by_hpr() {
  if (inside_mpi_job()) return std::getenv(kReportStartVariable) != nullptr;
  const char* const launcher = std::getenv(kLoneRankVariable);
  return launcher != nullptr && std::atoi(launcher) == ::getppid();
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
