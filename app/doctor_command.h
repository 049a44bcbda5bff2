#pragma once

#include <memory>

#include "app/command.h"
#include "app/doctor.h"

namespace hpr {

/// `hpr doctor`: what this machine can do, and the command that mends what it cannot. `graphics`: checks of the folders
/// that open devices, listed after the machine's own. Exit 1 when a finding is red.
[[nodiscard]] std::unique_ptr<Command> make_doctor_command(std::vector<Check> graphics = {});

}  // namespace hpr
