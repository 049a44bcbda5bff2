#pragma once

#include <string>

/// What this process knows of itself before MPI starts: its host, and what its environment says about the MPI job it
/// belongs to.
namespace hpr {

/// Set for rank 0, whose standard input is a pipe, when its launcher reads from a terminal.
inline constexpr const char* kTypedInputVariable = "HPR_TYPED_INPUT";
/// Set for the ranks of a job, whose stderr is a pipe, when their launcher's stderr is a terminal.
inline constexpr const char* kTerminalVariable = "HPR_TERMINAL";
/// Set for the ranks of a job that this program launched: rank 0 reports on standard output, before all else, that the
/// ranks have started. Open MPI takes variables of this prefix to other hosts.
inline constexpr const char* kReportStartVariable = "OMPI_HPR_SAY_START";

/// True when this process was started by mpirun, mpiexec or srun as one rank of a job.
[[nodiscard]] bool inside_mpi_job();

/// Set for a rank that this program launched without MPI, as the only one: the launcher's process number.
inline constexpr const char* kLoneRankVariable = "HPR_LONE_RANK";

/// True when this program launched the job, in a process that waits for this one.
[[nodiscard]] bool launched_by_hpr();

/// How many tasks srun started of which this process is one; 1 where it was not srun.
[[nodiscard]] int srun_tasks();

/// Whether nothing names other hosts: no batch system's allocation, no file of hosts, nor the system's own.
[[nodiscard]] bool is_one_host();

/// This process's rank as its launcher wrote it into the environment. 0 outside a job.
[[nodiscard]] int launched_rank();

/// Whether standard input of this process, or of its launcher, is a terminal.
[[nodiscard]] bool input_is_typed();

/// Whether stderr of this process, or of the launcher of its job, is a terminal: a progress bar may redraw itself.
[[nodiscard]] bool stderr_is_terminal();

/// The name of this machine.
[[nodiscard]] std::string host_name();

/// What stands before the words of a rank: "rank 3 on wall02: ", nothing for rank 0.
[[nodiscard]] std::string said_by(int rank);

}  // namespace hpr
