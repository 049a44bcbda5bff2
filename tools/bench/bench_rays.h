#pragma once

#include <vector>

#include "rt/trace/ray_scene.h"
#include "scene/scene.h"
#include "scene/view.h"
#include "tools/bench/bench.h"

namespace hpr {

/// Million rays per second of one thread: batches as ray passes make and trace them (from double, with validation and
/// the rule for ties) against a bare loop of rtcIntersect16 or rtcOccluded16 over packets that lie ready, in the same
/// Embree scene with the same flags. Primary rays of what `view` sees, whose pixels are multiples of four, and from
/// what they meet rays to the first light, mirrored and diffuse ones. Both sides in turns, a batch at a time, CPU time,
/// best of five. `rays` are built of all of `scene`.
[[nodiscard]] std::vector<BenchRow> bench_rays(const Scene& scene, const RayScene& rays, const View& view);

}  // namespace hpr
