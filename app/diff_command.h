#pragma once

#include <memory>

#include "app/command.h"

namespace hpr {

/// `hpr diff A B`: how far two pictures, or two files of keys, are apart. Exit 0 when within tolerance, else 1.
[[nodiscard]] std::unique_ptr<Command> make_diff_command();

}  // namespace hpr
