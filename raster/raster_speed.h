#pragma once

#include "raster/gl_context.h"

namespace hpr {

/// How fast OpenGL draws here, in nanoseconds of a rank's time, where no other work disturbs it: what a model of frames
/// is made of.
struct RasterSpeed {
  double triangle = 0.0;  ///< a small one, beyond its pixels
  double pixel = 0.0;     ///< filled once
  double read = 0.0;      ///< a pixel of what is drawn into: cleared, read back and made a key
  double draw = 0.0;      ///< a draw, however little there is to draw
  double spread = 1.0;    ///< the median of repetitions by the least of them
};

/// Draws a small fixed scene a few times, which takes a hundredth of a second on a CPU.
[[nodiscard]] RasterSpeed measure_raster_speed(GlContext& context);

}  // namespace hpr
