#pragma once

#include <memory>

#include "app/command.h"

namespace hpr {

/// `hpr wall init --cols C --rows R [--hosts LIST] ...`: a commented wall file to begin with, on stdout or in a file.
[[nodiscard]] std::unique_ptr<Command> make_wall_init_command();

}  // namespace hpr
