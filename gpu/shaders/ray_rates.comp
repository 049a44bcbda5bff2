// Rays that lie ready, as fast as a device traces them.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "scene.glsl"
#include "trace.glsl"

struct ReadyRay {
  dvec3 origin;
  dvec3 direction;
  double reach;
};
layout(buffer_reference, scalar) readonly buffer ReadyRays {
  ReadyRay rays[];
};
layout(buffer_reference, scalar) writeonly buffer Answers {
  uint hits[];
};
layout(push_constant, scalar) uniform Constants {
  ReadyRays of;
  Answers answers;
  SceneTrees scene;
  uint count;
  uint any;  // 1: whether they meet anything is enough
};

void main() {
  uint i = uint(thread_index());
  if (i >= count) return;
  ReadyRay ready = of.rays[i];
  NearestHit hit = NearestHit(ready.reach, kNoSurface, 0u);
  trace_ray(scene.tree, TracedRay(ready.origin, ready.direction, ready.reach, true, kNothingPassed), any != 0u, hit);
  answers.hits[i] = hit.surface != kNoSurface ? 1u : 0u;
}
