#pragma once

#include <memory>

#include "app/command.h"

namespace hpr {

/// `hpr view SCENE`: a wall in windows, or in a browser where there is no desktop.
[[nodiscard]] std::unique_ptr<Command> make_view_command();

}  // namespace hpr
