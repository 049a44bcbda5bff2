#pragma once

#include <functional>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <vector>

#include "core/error.h"

namespace hpr {

using Arguments = std::span<const std::string>;

/// One command of a session.
struct SessionCommand {
  std::string name;
  std::string usage;  ///< what follows the name
  std::string summary;
  /// Collective; `arguments` without the name. Returns the output, lines without a final newline. Throws Error.
  std::function<std::string(Arguments arguments)> run;
  bool only_tells = false;  ///< it changes nothing
};

/// The commands a session knows, `help` among them.
class CommandTable {
 public:
  CommandTable();
  ~CommandTable() = default;
  CommandTable(const CommandTable&) = delete;
  CommandTable& operator=(const CommandTable&) = delete;

  void add(SessionCommand command) { commands_.push_back(std::move(command)); }
  [[nodiscard]] const std::vector<SessionCommand>& commands() const { return commands_; }
  /// Runs one line: arguments separated by blanks, "quoted" where they hold some; what follows # is a comment. Throws
  /// Error (Usage) for unknown commands, and what the command throws.
  [[nodiscard]] std::string run(const std::string& line) const;
  /// Whether a line is there to be told something: what is being drawn stays as it is.
  [[nodiscard]] bool only_tells(const std::string& line) const;

 private:
  [[nodiscard]] std::string help(Arguments arguments) const;

  std::vector<SessionCommand> commands_;
};

/// Throws Error (Usage) that shows how the command is written.
[[noreturn]] void refuse(const std::string& problem, const std::string& example);

/// A finite number. Throws Error (Usage).
[[nodiscard]] double number_of(const std::string& text);
/// "X,Y,Z": three finite numbers. Throws Error (Usage).
[[nodiscard]] glm::dvec3 point_of(const std::string& text);

/// The direction to `point`, of length 1. Throws Error (Usage) for 0,0,0.
[[nodiscard]] glm::dvec3 direction_of(const glm::dvec3& point);

/// Whether an error concerns one command of a session only and leaves the session as it was.
[[nodiscard]] inline bool is_recoverable(const Error& error) {
  return error.code() == ExitCode::Usage || error.code() == ExitCode::BadInput || error.code() == ExitCode::Io ||
         error.code() == ExitCode::Limit;
}

}  // namespace hpr
