#include "cluster/transport/mpi_error.h"

#include <fmt/format.h>
#include <mpi.h>

#include <string>

#include "core/error.h"

namespace hpr {

void check_mpi(int code, const char* call) {
  if (code == MPI_SUCCESS) return;
  std::string text(MPI_MAX_ERROR_STRING, '\0');
  int length = 0;
  MPI_Error_string(code, text.data(), &length);
  text.resize(static_cast<std::size_t>(length));
  throw Error(ExitCode::Lost, fmt::format("{}: {}", call, text),
              "see the other ranks' messages; a host or rank may be gone");
}

}  // namespace hpr
