// A test's: samples and densities of environment.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "reals.glsl"
#include "sampling.glsl"

#include "discrete.glsl"

#include "environment.glsl"

struct Query {
  dvec3 normal;
  dvec3 direction;
  double choice;
  dvec2 u;
};
struct Answer {
  dvec3 sampled;
  dvec3 radiance;
  dvec3 radiance_alone;
  double pdf;
  double sampled_pdf;
  uint chosen;
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
  Environments environments;
  uint count;
};

void main() {
  uint i = uint(thread_index());
  if (i >= count) return;
  Query query = of.queries[i];
  Environment map = environments.environment;
  Answer answer;
  answer.chosen = sample_environment(map, query.normal, query.choice, query.u, answer.sampled) ? 1u : 0u;
  answer.radiance_alone = environment_light(map, query.direction);
  DirectionalRadiance seen = evaluate_environment(map, query.direction, query.normal);
  answer.radiance = seen.radiance;
  answer.pdf = seen.pdf;
  answer.sampled_pdf = answer.chosen != 0u ? evaluate_environment(map, answer.sampled, query.normal).pdf : 0.0lf;
  found.answers[i] = answer;
}
