#pragma once

#include <vector>

#include "raster/gl_context.h"
#include "tools/bench/bench_rows.h"

namespace hpr {

/// A frame of keys (cull, draw, read back, pack) against the barest GL loop: one glDrawElements of the same mesh into
/// the same formats, glReadPixels of both, glFinish. A displaced sphere of about 250 000 and 1 000 000 triangles at
/// 1920x1080, both sides in turn, medians in ms. Takes some seconds.
[[nodiscard]] std::vector<BenchRow> bench_raster(GlContext& context, int threads);

}  // namespace hpr
