#pragma once

#include <sys/types.h>

#include <array>
#include <csignal>
#include <cstddef>

#include "app/launch/launcher.h"

namespace hpr {

/// While it lives, SIGUSR1 and SIGUSR2 go on to mpiexec, which sends them to all ranks, unless this process ignores
/// them, and so does what interrupts a job in a process group of its own: this process leaves when its ranks have. A
/// second interrupt is not waited for. One at a time: signal handlers reach nothing but globals.
class PassedSignals {
 public:
  explicit PassedSignals(const JobOptions& options);
  /// Where a job was interrupted, and that was to end it, so is this process, as if the signal had not been caught.
  ~PassedSignals();
  PassedSignals(const PassedSignals&) = delete;
  PassedSignals& operator=(const PassedSignals&) = delete;

  static void to(pid_t child);
  /// The child was waited for: its number may soon be another process's.
  static void to_nobody();
  /// The ranks have started: requests that waited for that go out.
  static void note_start();

  /// Whether mpiexec was told to end, or will be as soon as there is one: nothing more is to be said.
  [[nodiscard]] static bool ends();
  /// The last signal that interrupted the job; 0: none did.
  [[nodiscard]] static int interrupted_by();

 private:
  static constexpr std::array kSignals{SIGALRM, SIGUSR1, SIGUSR2, SIGINT, SIGTERM, SIGHUP};
  std::size_t count_;  ///< of them, from the front
  std::array<struct sigaction, kSignals.size()> before_{};
};

}  // namespace hpr
