#pragma once

#include <sys/types.h>

namespace hpr {

/// Sends SIGKILL to a process, to the group it leads if it does, and to all that descend from it: a launcher of MPI may
/// give every rank a group of its own.
void kill_with_descendants(pid_t process);

}  // namespace hpr
