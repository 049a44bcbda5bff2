#include "core/peak_memory.h"

#include <sys/resource.h>

#include <fstream>
#include <string>

namespace hpr {

std::uint64_t peak_memory_bytes() {
  std::ifstream status("/proc/self/status");
  for (std::string name; status >> name;) {
    std::uint64_t kibibytes = 0;
    if (name == "VmHWM:" && status >> kibibytes) return kibibytes * 1024;
    status.ignore(1 << 16, '\n');
  }
  struct rusage usage {};  // which cannot begin anew
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

bool reset_peak_memory() {
  std::ofstream references("/proc/self/clear_refs");
  references << 5 << std::flush;  // VmHWM alone, proc(5)
  return references.good();
}

}  // namespace hpr
