#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "app/launcher.h"
#include "cluster/communicator.h"
#include "core/error.h"
#include "scene/load_scene.h"

namespace CLI {
class App;
}  // namespace CLI

namespace hpr {

/// The options every command has.
struct Globals {
  int verbosity = 0;  ///< -v, -vv; -1 is -q
  std::uint64_t seed = 1;
  std::string backend = "auto";
  int device = -1;  ///< -1: by local rank
  std::string progress = "auto";
  std::string limit_mem;
  std::string limit_image;
  std::string hang_timeout;
  bool force = false;             ///< overwrite files
  std::string trace;              ///< the file that shall tell where the time went; empty: none
  int ranks = 0;                  ///< 0: as many as the launcher started, else 1
  int threads = 0;                ///< of one rank; 0: the machine's cores divided among the ranks of a host
  std::vector<std::string> args;  ///< this process's command line after the program's name

  [[nodiscard]] SceneLimits scene_limits() const;
  [[nodiscard]] std::chrono::nanoseconds hang_limit() const;
};

/// One word after `hpr`: one file, listed in all_commands().
class Command {
 public:
  virtual ~Command() = default;

  [[nodiscard]] virtual std::string_view name() const = 0;
  [[nodiscard]] virtual std::string_view summary() const = 0;
  /// Declares options and subcommands on `app`, which outlives this; values land in the command's members.
  virtual void declare(CLI::App& app) = 0;
  /// Whether all ranks of a job run it. The others are rank 0's alone under mpirun: N copies would speak, and write, N
  /// times.
  [[nodiscard]] virtual bool collective() const { return false; }
  /// Called once the command line was parsed. Results go to stdout, messages to the log; throws Error.
  [[nodiscard]] virtual ExitCode run(const Globals& globals) = 0;
};

/// Every command, in the order `hpr help` lists them.
[[nodiscard]] std::vector<std::unique_ptr<Command>> all_commands();

/// Runs `body` on `globals.ranks` ranks. Inside an MPI job (mpirun, srun, or our own mpiexec) the job's ranks run it;
/// with one rank it runs here; otherwise mpiexec is started with this very command line and the body never runs here.
/// Returns what all ranks agreed on. Check whatever can be checked without the other ranks before calling it.
[[nodiscard]] ExitCode run_ranks(const Globals& globals, const std::function<ExitCode(Communicator&)>& body,
                                 const JobOptions& options = {});

/// What this rank may use of the machine it runs on.
struct HostShare {
  std::string host;
  int local_rank = 0;  ///< among the ranks of this host
  int ranks = 1;       ///< of this host
  int threads = 1;
};

/// Collective.
[[nodiscard]] HostShare host_share(Communicator& comm, const Globals& globals);

}  // namespace hpr
