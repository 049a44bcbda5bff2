// A test's: samples and densities of lights.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "reals.glsl"
#include "sampling.glsl"

#include "surface_point.glsl"
#include "view.glsl"

#include "textures.glsl"

#include "materials.glsl"

#include "discrete.glsl"

#include "environment.glsl"
#include "light_tree.glsl"
#include "punctual_lights.glsl"

#include "triangle_lights.glsl"

#include "lights.glsl"

struct Query {
  dvec3 position;
  dvec3 normal;
  dvec3 direction;
  dvec3 hit;
  double choice;
  dvec2 u;
  uint surface;
  uint enumerated;
};
struct Sampled {
  dvec3 to_light;
  double distance;
  dvec3 goal;
  double offset;
  dvec3 weight;
  double pdf;
  uint casts_shadows;
  uint chosen;
};
struct Answer {
  Sampled one;
  Sampled enumerated;
  dvec3 environment;
  double environment_pdf;
  double surface_pdf;
  uint enumerated_count;
  uint enumerated_is_fixed;
  uint has_tree;
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

Sampled as_sampled(LightSample light, bool chosen) {
  return Sampled(light.to_light, light.distance, light.goal, light.offset, light.weight, light.pdf,
                 light.casts_shadows ? 1u : 0u, chosen ? 1u : 0u);
}

void main() {
  uint i = uint(thread_index());
  if (i >= count) return;
  Query query = of.queries[i];
  View view;
  view.eye = dvec3(1.0lf, 2.0lf, 3.0lf);
  view.orthographic = 0u;
  Answer answer;
  LightSample light;
  bool chosen = sample_lights(lights, query.position, query.normal, view, query.choice, query.u, light);
  answer.one = as_sampled(light, chosen);
  answer.enumerated_count = enumerated_lights(lights);
  answer.enumerated = as_sampled(no_light(), false);
  answer.enumerated_is_fixed = 0u;
  if (query.enumerated < answer.enumerated_count) {
    answer.enumerated = as_sampled(sample_enumerated(lights, query.enumerated, query.position, view, query.u), true);
    answer.enumerated_is_fixed = enumerated_is_fixed(lights, query.enumerated) ? 1u : 0u;
  }
  answer.has_tree = has_tree(lights) ? 1u : 0u;
  answer.environment = environment_radiance(lights, query.direction);
  answer.environment_pdf = environment_pdf(lights, query.position, query.normal, query.direction);
  answer.surface_pdf = surface_pdf(lights, query.position, query.normal, query.surface, query.hit);
  found.answers[i] = answer;
}
