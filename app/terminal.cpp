#include "app/terminal.h"

#include <unistd.h>

#include <cstdlib>

#include "app/launcher.h"

namespace hpr {

bool stderr_is_terminal() {
  // NOLINTNEXTLINE(concurrency-mt-unsafe): nobody writes the environment
  return ::isatty(STDERR_FILENO) == 1 || (inside_mpi_job() && std::getenv(kTerminalVariable) != nullptr);
}

}  // namespace hpr
