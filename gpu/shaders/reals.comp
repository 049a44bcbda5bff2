// A test's: functions of reals.glsl and sampling.glsl, of some numbers.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "reals.glsl"
#include "sampling.glsl"

struct Reals {
  dvec2 circle;
  double arc_tangent;
  double exponential;
  double logarithm;
  double cube_root;
  dvec3 lobe;
  dvec3 cone;
  dvec3 sphere;
};
layout(buffer_reference, scalar) readonly buffer Numbers {
  dvec4 numbers[];
};
layout(buffer_reference, scalar) writeonly buffer FoundReals {
  Reals reals[];
};
layout(push_constant, scalar) uniform Constants {
  Numbers of;
  FoundReals found;
  uint count;
};

void main() {
  uint i = uint(thread_index());
  if (i >= count) return;
  dvec4 x = of.numbers[i];
  Reals each;
  each.circle = circle_at(x.x);
  each.arc_tangent = arc_tangent_of(x.x, x.y);
  each.exponential = exponential_of(x.x);
  each.logarithm = logarithm_of(abs(x.y));
  each.cube_root = cube_root_of(x.y);
  dvec3 axis = normalize(dvec3(x.xy, 0.25lf));
  each.lobe = cosine_lobe(axis, x.zw);
  each.cone = in_cone(-axis, 0.3lf * x.z, x.zw);
  each.sphere = on_sphere(x.zw);
  found.reals[i] = each;
}
