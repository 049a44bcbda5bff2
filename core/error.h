#pragma once

#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <utility>

/// Stops the program when the programmer broke a contract. Always on; never for user errors, never in inner loops.
#define HPR_CHECK(condition)                                                                     \
  do {                                                                                           \
    if (!(condition)) {                                                                          \
      std::fprintf(stderr, "hpr: %s:%d: broken contract: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                              \
    }                                                                                            \
  } while (false)

namespace hpr {

/// What the process leaves behind, the same on every rank (docs/commands.md).
enum class ExitCode : int {
  Done = 0,
  CheckFailed = 1,  ///< a check said no: a difference, a finding, a regression
  Usage = 2,
  BadInput = 3,  ///< the content of a scene, a wall or any other file
  Io = 4,        ///< cannot read or write, disk full
  NoDevice = 5,  ///< no usable graphics or ray device
  Limit = 6,
  Lost = 7,  ///< a rank, host or display
  Hang = 8,
  Internal = 70,
  Stopped = 75,  ///< early, with a valid checkpoint
  Skipped = 77,
};

/// A failure the user or the machine caused. Caught once, in `main`, which prints three lines: what went wrong and
/// where, the offending line of input where there is one, and a hint that says what to do.
class Error : public std::runtime_error {
 public:
  Error(ExitCode code, const std::string& what, std::string hint = {}, std::string line = {})
      : std::runtime_error(what), code_(code), hint_(std::move(hint)), line_(std::move(line)) {}

  [[nodiscard]] ExitCode code() const { return code_; }
  [[nodiscard]] const std::string& hint() const { return hint_; }
  /// The line of the user's input that is wrong; empty when there is none to show.
  [[nodiscard]] const std::string& line() const { return line_; }

 private:
  ExitCode code_;
  std::string hint_;
  std::string line_;
};

}  // namespace hpr
