#pragma once

namespace hpr {

/// Throws Error (Lost) with MPI's words when `call`, which returned `code`, failed.
void check_mpi(int code, const char* call);

}  // namespace hpr
