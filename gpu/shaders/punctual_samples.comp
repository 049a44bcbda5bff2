// A test's: samples of lights of punctual_lights.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "reals.glsl"
#include "sampling.glsl"

#include "view.glsl"

#include "punctual_lights.glsl"

struct Query {
  dvec3 position;
  dvec2 u;
  dvec3 eye;
  dvec3 back;
  uint orthographic;
  uint padding;
  PunctualLight light;
};
struct Answer {
  dvec3 to_light;
  double distance;
  dvec3 goal;
  dvec3 weight;
  uint casts_shadows;
  uint fixed_one;
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
  uint count;
};

void main() {
  uint i = uint(thread_index());
  if (i >= count) return;
  Query query = of.queries[i];
  View view;
  view.eye = query.eye;
  view.back = query.back;
  view.orthographic = query.orthographic;
  LightSample light = sample_punctual(query.light, query.position, view, query.u);
  found.answers[i] = Answer(light.to_light, light.distance, light.goal, light.weight, light.casts_shadows ? 1u : 0u,
                            is_fixed(query.light) ? 1u : 0u);
}
