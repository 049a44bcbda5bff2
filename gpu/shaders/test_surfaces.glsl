// Surface points as tests hand them over.
// Needs surface_point.glsl.

struct PlainSurface {
  dvec3 to_viewer;
  dvec3 geometric_normal;
  dvec3 shading_normal;
  dvec3 tangent;
  dvec3 bitangent;
  dvec4 color;
  vec2 uv[2];
  uint material;
  uint inside;
};

SurfacePoint surface_of(PlainSurface plain) {
  SurfacePoint point;
  point.position = dvec3(0.0lf);
  point.to_viewer = plain.to_viewer;
  point.geometric_normal = plain.geometric_normal;
  point.shading_normal = plain.shading_normal;
  point.lift = dvec3(0.0lf);
  point.offset = 0.0lf;
  point.color = plain.color;
  point.tangent = plain.tangent;
  point.bitangent = plain.bitangent;
  point.uv = plain.uv;
  point.surface = 0u;
  point.material = plain.material;
  point.layer = 0u;
  point.inside = plain.inside != 0u;
  return point;
}
