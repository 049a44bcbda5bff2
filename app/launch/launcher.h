#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cluster/transport/communicator.h"
#include "core/error.h"

namespace hpr {

/// What a job's ranks read on standard input.
enum class StandardInput : std::uint8_t {
  None,
  OfRank0,  ///< rank 0 reads what the launcher was given
};

/// What SIGINT and SIGTERM do to a job.
enum class Interrupts : std::uint8_t {
  End,   ///< end it
  Stop,  ///< the first one reaches its ranks as SIGUSR1: they come to an orderly end by themselves
};

/// A signal interrupted a job that it was to end (Interrupts::End), and is to end this process too, once what it made
/// is put away.
struct Interrupted {
  int signal;
};

/// The ranks of a job had not started in time. Open MPI also waits for ever where one is lost while it starts.
class LateStart final : public Error {
 public:
  using Error::Error;
};

/// The signal that interrupted the last job; 0: none did.
[[nodiscard]] int last_job_interrupt();

/// How a job is started.
struct JobOptions {
  std::string* captured_stdout = nullptr;  ///< where its standard output is collected; null: it passes through
  std::map<std::string, std::string> environment = {};  ///< added to this process's own
  /// The words that start them on hosts; none: mpiexec -n RANKS. Empty: nothing but this program, for one rank.
  std::optional<std::vector<std::string>> starter = {};
  StandardInput input = StandardInput::None;
  Interrupts interrupts = Interrupts::End;
  std::chrono::nanoseconds hang_limit = kHangTimeout;  ///< how long its ranks wait for each other
};

/// Called by rank 0 when all ranks of its job have started: notifies a launcher of this program that they take SIGUSR1
/// and SIGUSR2 now, if they ever do.
void notify_launcher();

/// Starts `ranks` processes of this very program with `args` under mpiexec, or what `options` name, and waits for them:
/// as root, in containers and with more ranks than cores, unbound and yielding when idle. Their stderr passes through.
/// Returns mpiexec's exit code. The job ends when this process does; SIGUSR1 and SIGUSR2 are passed on to its ranks,
/// once these have started, if this process watches for them (core/signals.h). A job that takes longer to start than
/// `options.hang_limit`, 10 s and half a second a rank is ended; one that does not end after SIGTERM, in as long as
/// that limit but at least 2 and at most 10 s, is killed; and one that goes on for so long after a rank has ended
/// before all had started is ended. Throws Error: Io when mpiexec or MPI cannot be started; Lost when a rank or mpiexec
/// itself was killed; Hang when mpiexec was stopped, or no rank of this host has got on, for longer than the ranks
/// report as their limit (core/job_board.h). Throws Interrupted.
int run_job(int ranks, const std::vector<std::string>& args, const JobOptions& options = {});

/// The first executable file of this name on the PATH.
[[nodiscard]] std::optional<std::filesystem::path> find_on_path(std::string_view program);

}  // namespace hpr
