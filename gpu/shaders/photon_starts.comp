// A test's: photons of photon_emission.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "reals.glsl"
#include "sampling.glsl"

#include "scene.glsl"
#include "surface_point.glsl"
#include "view.glsl"

#include "textures.glsl"

#include "materials.glsl"

#include "media.glsl"

#include "discrete.glsl"

#include "environment.glsl"
#include "light_tree.glsl"
#include "punctual_lights.glsl"

#include "triangle_lights.glsl"

#include "lights.glsl"

#include "photon_emission.glsl"

struct Query {
  double choice;
  dvec2 u_place;
  dvec2 u_direction;
};
struct Answer {
  dvec3 origin;
  dvec3 direction;
  dvec3 flux;
  double offset;
  dvec3 center;
  double range;
  Media media;
  uint surface;
  uint endless;
  uint emitted;
  uint padding;
};
layout(buffer_reference, scalar) readonly buffer Queries {
  Query queries[];
};
layout(buffer_reference, scalar) writeonly buffer Answers {
  Answer answers[];
};
layout(push_constant, scalar) uniform Constants {
  Queries of;
  Answers found;
  Lights lights;
  uint count;
};

void main() {
  uint i = uint(thread_index());
  if (i >= count) return;
  Query query = of.queries[i];
  PhotonStart start;
  bool emitted = emit_photon(lights, query.choice, query.u_place, query.u_direction, start);
  found.answers[i] = Answer(start.origin, start.direction, start.flux, start.offset, start.center, start.range, start.media,
                            start.surface, start.endless ? 1u : 0u, emitted ? 1u : 0u, 0u);
}
