#pragma once

#include <memory>

#include "app/command.h"

namespace hpr {

[[nodiscard]] std::unique_ptr<Command> make_tradeoff_command();

}  // namespace hpr
