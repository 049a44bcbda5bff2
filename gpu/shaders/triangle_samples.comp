// A test's: samples and densities of triangle_lights.glsl.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "reals.glsl"
#include "sampling.glsl"

#include "surface_point.glsl"
#include "view.glsl"

#include "textures.glsl"

#include "materials.glsl"

#include "punctual_lights.glsl"

#include "triangle_lights.glsl"

struct Query {
  dvec3 position;
  dvec2 u;
  uint triangle;
  uint surface;
};
struct Answer {
  dvec3 to_light;
  double distance;
  dvec3 goal;
  double offset;
  dvec3 weight;
  double pdf;
  double pdf_of_goal;
  double solid_angle;
  uint found;
  uint can_sample;
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
  TriangleLights triangles;
  Materials materials;
  uint64_t triangles_count;
  uint count;
};

void main() {
  uint i = uint(thread_index());
  if (i >= count) return;
  Query query = of.queries[i];
  TriangleLight triangle = triangles.lights[query.triangle];
  LightSample light = sample_triangle(materials, triangle, query.position, query.u);
  SphericalTriangle seen = spherical_triangle(query.position, triangle.v0, triangle.e1, triangle.e2);
  Answer answer;
  answer.to_light = light.to_light;
  answer.distance = light.distance;
  answer.goal = light.goal;
  answer.offset = light.offset;
  answer.weight = light.weight;
  answer.pdf = light.pdf;
  answer.pdf_of_goal = triangle_pdf(triangle, query.position, triangle.v0 + 0.25lf * triangle.e1 + 0.25lf * triangle.e2);
  answer.solid_angle = seen.solid_angle;
  answer.can_sample = can_sample(seen) ? 1u : 0u;
  uint which;
  bool is_there = find_triangle(triangles, uint(triangles_count), query.surface, which);
  answer.found = is_there ? which : 0xFFFFFFFFu;
  found.answers[i] = answer;
}
