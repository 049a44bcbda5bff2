#pragma once

namespace hpr {

/// Tells the ranks of a job, whose stderr is a pipe, that their launcher's is a terminal.
inline constexpr const char* kTerminalVariable = "HPR_TERMINAL";

/// Whether somebody looks on at a terminal: what is drawn on stderr may be drawn over.
[[nodiscard]] bool stderr_is_terminal();

}  // namespace hpr
