#pragma once

#include <cstdint>

namespace hpr {

/// What the user asked a long run for by a signal.
enum class Request : std::uint8_t {
  None,
  Write,  ///< SIGUSR2: write a checkpoint and go on
  Stop,   ///< SIGUSR1: write a checkpoint and stop
};

/// From now on SIGUSR1 and SIGUSR2 are remembered by this process instead of ending it.
void watch_requests();

/// The same, and SIGINT, SIGTERM and SIGHUP are Request::Stop; a second one of these three ends this process.
void watch_interrupts();

/// The signal that came last of those; 0: none.
[[nodiscard]] int last_signal();

/// The strongest request since the last call.
[[nodiscard]] Request take_request();

}  // namespace hpr
