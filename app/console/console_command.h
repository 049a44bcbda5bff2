#pragma once

#include <memory>

#include "app/command.h"

namespace hpr {

/// `hpr console SCENE`.
[[nodiscard]] std::unique_ptr<Command> make_console_command();

}  // namespace hpr
