#pragma once

#include <memory>

#include "app/command.h"

namespace hpr {

/// `hpr wall import FILE --from KIND`: another system's wall file as one of ours, on stdout.
[[nodiscard]] std::unique_ptr<Command> make_wall_import_command();

}  // namespace hpr
