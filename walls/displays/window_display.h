#pragma once

#include "walls/displays/display.h"

namespace hpr {

/// Windows on this host's desktop, by GLFW: one per window of the wall file, or one per screen. Closing one, or Escape,
/// ends the run; the mouse moves the camera.
[[nodiscard]] std::unique_ptr<Display> make_window_display(const Wall& wall, const DisplayOptions& options);
/// Looks for a desktop, unless the windows are on other hosts or displays than this process's.
void check_window_display(const Wall& wall, const DisplayOptions& options);

/// Whether this process can reach a desktop.
[[nodiscard]] bool has_desktop();

}  // namespace hpr
