#pragma once

#include "walls/displays/display.h"

namespace hpr {

/// Frames as raw RGBA or YUV4MPEG2, one after the other, to another program: the assembled wall with its gaps, or one
/// screen. Every frame has the size of the first.
[[nodiscard]] std::unique_ptr<Display> make_pipe_display(const Wall& wall, const DisplayOptions& options);
void check_pipe_display(const Wall& wall, const DisplayOptions& options);

}  // namespace hpr
