#pragma once

#include <memory>

#include "app/command.h"

namespace hpr {

/// `hpr display`: a display process outside the MPI job.
[[nodiscard]] std::unique_ptr<Command> make_display_command();

}  // namespace hpr
