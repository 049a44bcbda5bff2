#pragma once

#include "core/error.h"

namespace hpr {

/// What goes wrong with one command of a session, and leaves the session as it was.
[[nodiscard]] inline bool is_recoverable(const Error& error) {
  return error.code() == ExitCode::Usage || error.code() == ExitCode::BadInput || error.code() == ExitCode::Io ||
         error.code() == ExitCode::Limit;
}

}  // namespace hpr
