// A test's: what rays meet where surfaces cover in part, and how much light gets through.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "reals.glsl"
#include "sampling.glsl"
#include "sampler.glsl"
#include "scene.glsl"
#include "surface_point.glsl"
#include "surfaces.glsl"
#include "textures.glsl"
#include "materials.glsl"
#include "media.glsl"
#include "microfacets.glsl"
#include "all_bsdfs.glsl"
#include "path.glsl"
#include "trace.glsl"
#include "coverage.glsl"

struct SentRay {
  dvec3 origin;
  dvec3 direction;
  double reach;
  uint64_t stream;
  uint meets_backs;
  uint is_shadow;
};
struct Outcome {
  double passed;
  uint surface;
  uint draw;  // the next one
  uint cut;
  uint is_unfinished;
};
layout(buffer_reference, scalar) readonly buffer SentRays {
  SentRay rays[];
};
layout(buffer_reference, scalar) writeonly buffer Outcomes {
  Outcome outcomes[];
};
layout(push_constant, scalar) uniform Constants {
  SentRays of;
  Outcomes found;
  SceneTrees opaque;
  SceneTrees alpha_tested;
  SurfaceTables surfaces;
  Materials materials;
  uint count;
};

void main() {
  uint i = uint(thread_index());
  if (i >= count) return;
  SentRay sent = of.rays[i];
  TracedRay ray = TracedRay(sent.origin, sent.direction, sent.reach, sent.meets_backs != 0u, kNothingPassed);
  Sampler random = make_sampler(sent.stream, i);
  CoverageNotes notes = CoverageNotes(0u, false);
  Outcome outcome;
  outcome.surface = kNoSurface;
  outcome.passed = 1.0lf;
  if (sent.is_shadow != 0u) {
    outcome.passed = passed_fraction(opaque, alpha_tested, surfaces, materials, ray, notes);
  } else {
    outcome.surface = closest_by_chance(opaque, alpha_tested, surfaces, materials, ray, random, notes);
  }
  outcome.draw = one(random);
  outcome.cut = notes.cut;
  outcome.is_unfinished = notes.is_unfinished ? 1u : 0u;
  found.outcomes[i] = outcome;
}
