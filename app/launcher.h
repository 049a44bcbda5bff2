#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace hpr {

/// What a job's ranks read on standard input.
enum class StandardInput {
  None,
  OfRank0,  ///< rank 0 reads what the launcher was given
};

/// Whether somebody types what this process reads on standard input, at a terminal of its own or its launcher's.
[[nodiscard]] bool input_is_typed();

/// True when this process was started by mpirun, mpiexec or srun as one rank of a job.
[[nodiscard]] bool inside_mpi_job();

/// This process's rank as its launcher wrote it into the environment: known before MPI starts. 0 outside a job.
[[nodiscard]] int launched_rank();

/// Starts `ranks` processes of this very program with `args` under mpiexec and waits for them: as root, in containers
/// and with more ranks than cores, unbound and yielding when idle. Their stderr passes through; their stdout passes
/// through or, when `captured_stdout` is given, is collected there. Returns mpiexec's exit code. The job ends when this
/// process does; SIGUSR1 and SIGUSR2 are passed on to its ranks. Throws Error: Io when mpiexec cannot be started, Lost
/// when a rank or mpiexec itself was killed.
int run_mpiexec(int ranks, const std::vector<std::string>& args, std::string* captured_stdout = nullptr,
                const std::map<std::string, std::string>& extra_env = {}, StandardInput input = StandardInput::None);

/// The first executable file of this name on the PATH.
[[nodiscard]] std::optional<std::filesystem::path> find_on_path(std::string_view program);

/// The path of the running program.
[[nodiscard]] std::string program_path();

}  // namespace hpr
