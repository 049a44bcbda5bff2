#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "app/options/globals.h"
#include "core/error.h"

namespace CLI {
class App;
}  // namespace CLI

namespace hpr {

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

}  // namespace hpr
