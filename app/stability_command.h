#pragma once

#include <memory>

#include "app/command.h"

namespace hpr {

/// `hpr stability`: every extreme's limit, what was measured and where it breaks. Exit 1 when a promise does not hold.
[[nodiscard]] std::unique_ptr<Command> make_stability_command();

}  // namespace hpr
