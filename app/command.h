#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "app/options/globals.h"
#include "app/options/option_set.h"
#include "core/error.h"

namespace hpr {

/// A command of the program, the first argument of `hpr`, or a subcommand, the argument after its parent's name.
class Command {
 public:
  virtual ~Command() = default;

  [[nodiscard]] virtual std::string_view name() const = 0;
  [[nodiscard]] virtual std::string_view summary() const = 0;
  /// The commands below this one; where there are any, one of them is run in its place.
  [[nodiscard]] virtual std::vector<std::unique_ptr<Command>> subcommands() const { return {}; }
  /// Declares the options; their values go to the command's members.
  virtual void declare(const OptionSet& /*options*/) {}
  /// Whether all ranks of a job run it. Other commands run on rank 0 alone under mpirun: every rank would print, and
  /// write, the result.
  [[nodiscard]] virtual bool collective() const { return false; }
  /// Whether it may open windows: then `--backend glfw` has a meaning.
  [[nodiscard]] virtual bool opens_windows() const { return false; }
  /// Called once the command line was parsed. Results go to stdout, messages to the log; throws Error.
  [[nodiscard]] virtual ExitCode run(const Globals& globals) = 0;
};

/// A command that is nothing but its subcommands.
class CommandGroup : public Command {
 public:
  CommandGroup(std::string_view name, std::string_view summary) : name_(name), summary_(summary) {}

  [[nodiscard]] std::string_view name() const final { return name_; }
  [[nodiscard]] std::string_view summary() const final { return summary_; }
  [[nodiscard]] std::vector<std::unique_ptr<Command>> subcommands() const override = 0;
  [[nodiscard]] ExitCode run(const Globals& /*globals*/) final { return ExitCode::Usage; }

 private:
  std::string_view name_;
  std::string_view summary_;
};

/// One command of each class.
template <typename... Commands>
[[nodiscard]] std::vector<std::unique_ptr<Command>> commands_of() {
  std::vector<std::unique_ptr<Command>> all;
  (all.push_back(std::make_unique<Commands>()), ...);
  return all;
}

/// Every command, in the order `hpr help` lists them.
[[nodiscard]] std::vector<std::unique_ptr<Command>> all_commands();

}  // namespace hpr
