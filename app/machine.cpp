#include "app/machine.h"

#include <fstream>

#include "cluster/mpi_communicator.h"
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

Machine this_machine() {
  return {cpu_model(), usable_cores(), mpi_version()};
}

}  // namespace hpr
