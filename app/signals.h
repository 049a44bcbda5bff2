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

/// From now on SIGUSR1, SIGINT and SIGTERM of this process are Request::Stop; a second SIGINT or SIGTERM ends it.
void watch_interrupts();

/// The strongest request since the last call.
[[nodiscard]] Request take_request();

}  // namespace hpr
