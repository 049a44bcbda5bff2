#pragma once

#include <string>
#include <vector>

#include "raster/gl_context.h"

namespace hpr {

/// One line of `hpr bench`: what we need for something, and what a floor or peer needs for it on the same input.
struct BenchRow {
  std::string name;
  double ours = 0.0;
  double floor = 0.0;  ///< 0: there is none
  std::string unit;
  double ratio = 0.0;  ///< our speed / the floor's: 1 is equal, more is faster; 0 without a floor
};

/// A frame of keys (cull, draw, read back, pack) against the barest GL loop: one glDrawElements of the same mesh into
/// the same formats, glReadPixels of both, glFinish. A displaced sphere of about 250 000 and 1 000 000 triangles at
/// 1920x1080, both sides in turn, medians in ms. Takes some seconds.
[[nodiscard]] std::vector<BenchRow> bench_raster(GlContext& context, int threads);

}  // namespace hpr
