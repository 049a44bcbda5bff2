#pragma once

namespace hpr {

/// From now on this process ends with an error message and exit code Lost when the connection to its X server breaks.
/// Xlib has no way back from that: by itself it ends the process with 1.
void end_with_x_server();

}  // namespace hpr
