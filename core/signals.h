#pragma once

#include <cstdint>

namespace hpr {

/// A user's request to a long run, made by a signal.
enum class Request : std::uint8_t {
  None,
  Write,  ///< SIGUSR2: write a checkpoint and go on
  Stop,   ///< SIGUSR1: write a checkpoint and stop
};

/// From now on this process records SIGUSR1 and SIGUSR2, which no longer end it.
void watch_requests();

/// From now on this process records SIGUSR1 and SIGUSR2, and takes SIGINT, SIGTERM and SIGHUP as Request::Stop, which
/// it announces; a second one of these three ends it.
void watch_interrupts();

/// From now on the first signal that has a run come to its end is announced: one line on stderr. To be called at most
/// once, before any watching, by the process that speaks for the run. `on_terminal`: a progress bar may stand there.
void announce_ends(bool on_terminal);

/// In a signal handler: a run is told to end, and will not at once. Keeps errno.
void announce_end();

/// The last recorded signal; 0: none.
[[nodiscard]] int last_signal();

/// The strongest request since the last call.
[[nodiscard]] Request take_request();

}  // namespace hpr
