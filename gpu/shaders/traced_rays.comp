// A test's: what rays meet.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "reals.glsl"
#include "scene.glsl"
#include "trace.glsl"

struct GivenRay {
  dvec3 origin;
  dvec3 direction;
  double reach;
  uint meets_backs;
  uint padding;
};
layout(buffer_reference, scalar) readonly buffer GivenRays {
  GivenRay rays[];
};
layout(buffer_reference, scalar) writeonly buffer MetSurfaces {
  uvec2 met[];
};
layout(push_constant, scalar) uniform Constants {
  GivenRays of;
  MetSurfaces found;
  SceneTrees scene;
  uint count;
};

void main() {
  uint i = uint(thread_index());
  if (i >= count) return;
  GivenRay traced = of.rays[i];
  TracedRay ray = TracedRay(traced.origin, traced.direction, traced.reach, traced.meets_backs != 0u, kNothingPassed);
  found.met[i] = uvec2(closest_surface(scene.tree, ray), is_blocked(scene.tree, ray) ? 1u : 0u);
}
