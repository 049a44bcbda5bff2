// A test's: points where rays meet surfaces.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "reals.glsl"
#include "scene.glsl"
#include "surface_point.glsl"
#include "surfaces.glsl"

struct Meeting {
  dvec3 origin;
  dvec3 direction;
  uint surface;
  uint padding;
};
struct FoundPoint {
  dvec3 vectors[7];
  double offset;
  dvec4 color;
  vec2 uv[2];
  uint material;
  uint layer;
  uint inside;
  uint padding;
};
layout(buffer_reference, scalar) readonly buffer Meetings {
  Meeting meetings[];
};
layout(buffer_reference, scalar) writeonly buffer FoundPoints {
  FoundPoint points[];
};
layout(push_constant, scalar) uniform Constants {
  Meetings of;
  FoundPoints found;
  SurfaceTables surfaces;
  uint count;
};

void main() {
  uint i = uint(thread_index());
  if (i >= count) return;
  Meeting met = of.meetings[i];
  SurfacePoint point = meet_surface(surfaces.table, met.surface, met.origin, met.direction);
  FoundPoint each;
  each.vectors = dvec3[](point.position, point.to_viewer, point.geometric_normal, point.shading_normal, point.lift,
                         point.tangent, point.bitangent);
  each.offset = point.offset;
  each.color = point.color;
  each.uv = point.uv;
  each.material = point.material;
  each.layer = point.layer;
  each.inside = point.inside ? 1u : 0u;
  each.padding = 0u;
  found.points[i] = each;
}
