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

/// From now on this process records SIGUSR1 and SIGUSR2, and takes SIGINT, SIGTERM and SIGHUP as Request::Stop; a
/// second one of these three ends it.
void watch_interrupts();

/// The last recorded signal; 0: none.
[[nodiscard]] int last_signal();

/// The strongest request since the last call.
[[nodiscard]] Request take_request();

}  // namespace hpr
