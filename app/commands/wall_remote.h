#pragma once

#include <memory>
#include <vector>

#include "app/command.h"

namespace hpr {

/// `hpr wall status|ctl|stop`: what is said to a wall that runs.
[[nodiscard]] std::vector<std::unique_ptr<Command>> make_wall_remote_commands();

}  // namespace hpr
