#include "app/doctor/machine.h"

#include <sched.h>
#include <unistd.h>

#include <fstream>

#include "cluster/transport/mpi_communicator.h"
#include "core/job_environment.h"
#include "core/parallel.h"

namespace hpr {
namespace {

std::string cpu_model() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (!line.starts_with("model name")) continue;
    const auto colon = line.find(": ");
    if (colon != std::string::npos) return line.substr(colon + 2);
  }
  return "unknown";
}

}  // namespace

int job_cores() {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  if (::sched_getaffinity(0, sizeof(cores), &cores) != 0) return usable_cores();
  if (inside_mpi_job()) {
    // Whoever started this rank is mostly free to use what the whole job may; a script between may not be.
    cpu_set_t launcher;
    CPU_ZERO(&launcher);
    if (::sched_getaffinity(::getppid(), sizeof(launcher), &launcher) == 0) CPU_OR(&cores, &cores, &launcher);
  }
  return CPU_COUNT(&cores);
}

Machine this_machine() {
  return {cpu_model(), job_cores(), mpi_version()};
}

}  // namespace hpr
