#include "app/machine.h"

#include <algorithm>
#include <fstream>
#include <thread>

#include "cluster/mpi_communicator.h"

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
  return {cpu_model(), std::max(1, static_cast<int>(std::thread::hardware_concurrency())), mpi_version()};
}

}  // namespace hpr
