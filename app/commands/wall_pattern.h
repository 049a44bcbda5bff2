#pragma once

#include <memory>

#include "app/command.h"

namespace hpr {

/// `hpr wall pattern WALL -o DIR`, or `--display NAME`: calibration pictures in files, or on the wall with a counter.
[[nodiscard]] std::unique_ptr<Command> make_wall_pattern_command();

}  // namespace hpr
