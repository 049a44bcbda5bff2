#pragma once

#include "walls/displays/display.h"

namespace hpr {

/// A page for browsers with the assembled wall, or one screen; the mouse moves the camera. See WebServer.
[[nodiscard]] std::unique_ptr<Display> make_web_display(const Wall& wall, const DisplayOptions& options);
void check_web_display(const Wall& wall, const DisplayOptions& options);

}  // namespace hpr
