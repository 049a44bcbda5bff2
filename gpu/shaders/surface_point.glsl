// Where a ray meets a surface, and all that shading needs of the place: SurfacePoint of rt/trace/surfaces.h. World coordinates,
// metres.

struct SurfacePoint {
  dvec3 position;
  dvec3 to_viewer;         // unit length, against the ray
  dvec3 geometric_normal;  // unit length, on the viewer's side
  dvec3 shading_normal;    // unit length, interpolated, on the geometric normal's side
  dvec3 lift;              // of the origins of shadow rays
  double offset;           // metres by which ray origins must leave the surface along the geometric normal
  dvec4 color;             // of the vertices, linear RGBA; 1 where they have none
  dvec3 tangent;           // zero where there is none, as needs_tangents() has it
  dvec3 bitangent;
  vec2 uv[2];
  uint surface;
  uint material;
  uint layer;
  bool inside;  // the viewer is behind the face
};

// The normal to shade with, but for maps.
dvec3 facing_normal(SurfacePoint point) {
  return dot(point.shading_normal, point.to_viewer) > 0.0lf ? point.shading_normal : point.geometric_normal;
}

// Where rays leave a surface towards `direction`.
dvec3 ray_origin(SurfacePoint point, dvec3 direction) {
  double side = dot(direction, point.geometric_normal) < 0.0lf ? -1.0lf : 1.0lf;
  return point.position + side * point.offset * point.geometric_normal;
}
