#pragma once

namespace hpr {

/// Has this process end, from now on, with an error message and exit code Lost when the connection to its X server
/// breaks. Xlib has no way back from that: by itself it ends the process with 1. Declared apart from what calls it,
/// because Xlib defines None, Bool and such as macros.
void end_with_x_server();

}  // namespace hpr
