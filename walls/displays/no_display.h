#pragma once

#include "walls/displays/display.h"

namespace hpr {

/// Shows nothing: for measuring, and for runs whose other results count.
[[nodiscard]] std::unique_ptr<Display> make_no_display(const Wall& wall, const DisplayOptions& options);
void check_no_display(const Wall& wall, const DisplayOptions& options);

}  // namespace hpr
