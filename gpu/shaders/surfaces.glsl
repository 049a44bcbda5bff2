// Surface ids -> triangles -> points: rt/trace/surfaces.h. Needs reals.glsl, scene.glsl, surface_point.glsl.

layout(buffer_reference, scalar) readonly buffer Vectors {
  vec3 vectors[];
};
layout(buffer_reference, scalar) readonly buffer TextureCoordinates {
  vec2 uvs[];
};
layout(buffer_reference, scalar) readonly buffer Vectors4 {
  vec4 vectors[];
};

// An instance of the scene, and what its mesh's vertices have. Arrays that there are not are null.
struct Placement {
  dmat4x3 to_world;
  dmat3 normal_matrix;
  dmat3 spread;  // zero but for meshes that are instances to the CPU's rays
  dvec3 reach;
  dvec2 map[3];  // KHR_texture_transform of the texture by whose coordinates tangents go
  Positions positions;
  Triangles triangles;
  Vectors normals;
  TextureCoordinates uvs[2];
  Vectors4 colors;
  Vectors4 tangents;
  Indices parts;  // of surfaces that cover in part: which part of the mesh each triangle is of
  uint first_surface;
  uint material;
  uint map_uv_set;
  uint traits;
};
const uint kSwapsHandedness = 1u;
const uint kIsRefined = 2u;
const uint kIsInstanced = 4u;
const uint kNeedsTangents = 8u;

layout(buffer_reference, scalar) readonly buffer Placements {
  Placement placements[];
};
struct SurfaceTable {
  Placements placements;  // by first_surface
  dvec3 space_origin;     // RaySpace
  double space_scale;
  uint count;
  uint lifts;  // whether points have a lift
};
layout(buffer_reference, scalar) readonly buffer SurfaceTables {
  SurfaceTable table;
};

const double kFloatStep = 1.1920928955078125e-7lf;
const double kOriginSteps = 4.0lf;

struct WorldTriangle {
  uint surface;
  uint placement;
  uint index;
  uvec3 corners;
  dvec3 v0;
  dvec3 e1;
  dvec3 e2;
  dvec3 normal;      // by the winding; zero when the triangle has no area
  dvec3 normals[3];  // of the corners
  double offset;
};

bool is_plain(double length2) {
  return length2 > 1e-200lf && length2 < 1e200lf;
}

double largest_size(dvec3 v) {
  return largest(abs(v));
}

// At unit length; `otherwise` where it has none.
dvec3 unit_or(dvec3 v, dvec3 otherwise) {
  double length2 = dot(v, v);
  if (is_plain(length2)) return v * (1.0lf / sqrt(length2));
  double size = largest_size(v);
  if (!(size > 0.0lf) || isnan(v.x + v.y + v.z) || isinf(size)) return otherwise;
  return normalize(v / size);
}

dvec3 direction_of_cross(dvec3 a, dvec3 b) {
  dvec3 product = cross(a, b);
  double length2 = dot(product, product);
  if (is_plain(length2)) return product * (1.0lf / sqrt(length2));
  double sa = largest_size(a);
  double sb = largest_size(b);
  if (!(sa > 0.0lf) || !(sb > 0.0lf)) return dvec3(0.0lf);
  return unit_or(cross(a / sa, b / sb), dvec3(0.0lf));
}

dmat3 linear_part(dmat4x3 to_world) {
  return dmat3(to_world[0], to_world[1], to_world[2]);
}

// Metres, with a margin: what rounding a place's coordinates may move it by.
double rounding_at(SurfaceTable table, dvec3 place) {
  return kOriginSteps * kFloatStep * largest_size(place - table.space_origin);
}

double row_sum_norm(dmat3 m) {
  return largest(abs(m[0]) + abs(m[1]) + abs(m[2]));
}

double plane_rounding(dvec3 e1, dvec3 e2, dvec3 normal, dvec3 corners) {
  dvec3 a = abs(e1);
  dvec3 b = abs(e2);
  dvec3 products = dvec3(a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x);
  double area2 = abs(dot(normal, cross(e1, e2)));
  return dot(abs(normal), corners) + dot(max(a, b), products) / area2;
}

double offset_of(SurfaceTable table, Placement placed, dvec3 v0, dvec3 e1, dvec3 e2, dvec3 normal) {
  const double kMinOffset = 9.094947017729282379e-13lf;  // 2^-40
  dvec3 extent = max(abs(e1), abs(e2));
  dvec3 from_origin = abs(v0 - table.space_origin);
  dvec3 corners = from_origin + extent;
  double most = largest_size(from_origin) + largest_size(extent);
  if ((placed.traits & kIsInstanced) != 0u) {
    most = max(most, row_sum_norm(placed.spread) * most + largest_size(placed.reach));
    corners = max(corners, placed.spread * corners + placed.reach);
  }
  double along = plane_rounding(e1, e2, normal, corners);
  return max(kOriginSteps * kFloatStep * (along < most ? along : most), kMinOffset / table.space_scale);
}

// The last placement that begins at or before the surface.
uint placement_of(SurfaceTable table, uint surface) {
  uint low = 0u;
  uint high = table.count;
  while (low + 1u < high) {
    uint middle = (low + high) / 2u;
    if (table.placements.placements[middle].first_surface <= surface) {
      low = middle;
    } else {
      high = middle;
    }
  }
  return low;
}

WorldTriangle load_triangle(SurfaceTable table, uint surface) {
  WorldTriangle triangle;
  triangle.surface = surface;
  triangle.placement = placement_of(table, surface);
  Placement placed = table.placements.placements[triangle.placement];
  triangle.index = surface - placed.first_surface;
  triangle.corners = placed.triangles.triangles[triangle.index];
  dmat3 linear = linear_part(placed.to_world);
  dvec3 p0 = dvec3(placed.positions.positions[triangle.corners.x]);
  triangle.v0 = linear * p0 + placed.to_world[3];
  triangle.e1 = linear * (dvec3(placed.positions.positions[triangle.corners.y]) - p0);
  triangle.e2 = linear * (dvec3(placed.positions.positions[triangle.corners.z]) - p0);
  triangle.normal = direction_of_cross(triangle.e1, triangle.e2);
  for (int corner = 0; corner < 3; ++corner) {
    dvec3 normal = dvec3(placed.normals.vectors[triangle.corners[corner]]);
    triangle.normals[corner] = unit_or(placed.normal_matrix * normal, triangle.normal);
  }
  triangle.offset = offset_of(table, placed, triangle.v0, triangle.e1, triangle.e2, triangle.normal);
  return triangle;
}

// Barycentric coordinates moved onto the triangle; its middle where they are undefined.
dvec2 onto_triangle(dvec2 at) {
  if (!is_finite(at.x) || !is_finite(at.y)) return dvec2(1.0lf / 3.0lf);
  at = max(at, dvec2(0.0lf));
  return at / max(at.x + at.y, 1.0lf);
}

// onto_refined() of rt/trace/refined_triangles.cpp: very large triangles are met in parts, whose rounding is that of what lies near.
dvec2 onto_refined(SurfaceTable table, dvec2 at, WorldTriangle triangle, dvec3 origin, dvec3 direction) {
  if (at.x >= 0.0lf && at.y >= 0.0lf && at.x + at.y <= 1.0lf) return at;
  dvec3 normal = cross(triangle.e1, triangle.e2);
  double area = length(normal);
  double far_off = length(triangle.v0 - table.space_origin + at.x * triangle.e1 + at.y * triangle.e2);
  double start = min(length(origin - table.space_origin), 8.0lf / table.space_scale);
  double steps = 5.0lf * (8.5lf * far_off + start) + start + (far_off + start);
  double cosine = abs(dot(normal, direction)) / (area * length(direction));
  double margin = kFloatStep * steps / max(cosine, 1.0lf / 4096.0lf);
  double below_v = margin * length(triangle.e1) / area;
  double below_u = margin * length(triangle.e2) / area;
  double past = margin * distance(triangle.e1, triangle.e2) / area;
  if (!is_finite(at.x) || !is_finite(at.y) || !is_finite(below_u + below_v + past)) return onto_triangle(at);
  dvec2 moved = dvec2(max(at.x, -below_u), max(at.y, -below_v));
  double sum = moved.x + moved.y;
  return sum > 1.0lf + past ? moved * ((1.0lf + past) / sum) : moved;
}

double refined_offset(SurfaceTable table, dvec3 position) {
  const double kPlaneSteps = 32.0lf;
  const double kMinEdge = 1.0lf / 16777216.0lf;
  return kPlaneSteps * max(rounding_at(table, position), kOriginSteps * kFloatStep * kMinEdge / table.space_scale);
}

dvec2 uv_of(TextureCoordinates uvs, uvec3 corners, dvec3 weights) {
  return weights.x * dvec2(uvs.uvs[corners.x]) + weights.y * dvec2(uvs.uvs[corners.y]) +
         weights.z * dvec2(uvs.uvs[corners.z]);
}

dvec2 map_uv(Placement placed, vec2 uv) {
  return placed.map[0] * double(uv.x) + placed.map[1] * double(uv.y) + placed.map[2];
}

// As the mesh's own tangents have it; false where they have no direction.
bool add_own_tangents(Placement placed, uvec3 corners, dvec3 weights, dvec3 normal, double side, inout SurfacePoint point) {
  // Read whole: of single components of what is read twice, lavapipe mixes up which.
  vec4 first = placed.tangents.vectors[corners.x];
  dvec3 along = weights.x * dvec3(first.xyz) + weights.y * dvec3(placed.tangents.vectors[corners.y].xyz) +
                weights.z * dvec3(placed.tangents.vectors[corners.z].xyz);
  dmat3 linear = linear_part(placed.to_world);
  dvec3 across = double(first.w) * cross(normal, along);
  point.tangent = side * unit_or(linear * along, dvec3(0.0lf));
  point.bitangent = side * unit_or(linear * across, dvec3(0.0lf));
  return point.tangent != dvec3(0.0lf) && point.bitangent != dvec3(0.0lf);
}

void add_map_tangents(Placement placed, uvec3 corners, dvec3 normal, double side, inout SurfacePoint point) {
  TextureCoordinates uvs = placed.uvs[min(placed.map_uv_set, 1u)];
  point.tangent = dvec3(0.0lf);
  point.bitangent = dvec3(0.0lf);
  if (uint64_t(uvs) == 0ul) return;
  dvec2 uv0 = map_uv(placed, uvs.uvs[corners.x]);
  dvec2 d1 = map_uv(placed, uvs.uvs[corners.y]) - uv0;
  dvec2 d2 = map_uv(placed, uvs.uvs[corners.z]) - uv0;
  dvec3 p0 = dvec3(placed.positions.positions[corners.x]);
  dvec3 e1 = dvec3(placed.positions.positions[corners.y]) - p0;
  dvec3 e2 = dvec3(placed.positions.positions[corners.z]) - p0;
  normal = unit_or(normal, direction_of_cross(e1, e2));
  double turn = d1.x * d2.y - d1.y * d2.x < 0.0lf ? -1.0lf : 1.0lf;
  dvec3 by_u = turn * (d2.y * e1 - d1.y * e2);
  dvec3 by_v = turn * (d1.x * e2 - d2.x * e1);
  dvec3 along = unit_or(by_u - dot(by_u, normal) * normal, dvec3(0.0lf));
  dvec3 across = cross(normal, along);
  dmat3 linear = linear_part(placed.to_world);
  point.tangent = side * unit_or(linear * along, dvec3(0.0lf));
  point.bitangent = (dot(across, by_v) > 0.0lf ? -side : side) * unit_or(linear * across, dvec3(0.0lf));
}

void add_tangents(Placement placed, WorldTriangle triangle, dvec3 weights, inout SurfacePoint point) {
  double side = point.inside ? -1.0lf : 1.0lf;
  dvec3 normal = dvec3(0.0lf);
  for (int corner = 0; corner < 3; ++corner) {
    normal += weights[corner] * dvec3(placed.normals.vectors[triangle.corners[corner]]);
  }
  bool has_own = uint64_t(placed.tangents) != 0ul &&
                 add_own_tangents(placed, triangle.corners, weights, normal, side, point);
  if (!has_own) add_map_tangents(placed, triangle.corners, normal, side, point);
}

uint layer_of(Placement placed, uint placement, uint triangle, bool inside) {
  if (uint64_t(placed.parts) == 0ul) return 0u;
  uint64_t number = uint64_t(placement) * 31ul + uint64_t(placed.parts.indices[triangle]);
  return 2u * (1u + uint(number % 127ul)) + (inside ? 1u : 0u);
}

// The point where the ray meets the triangle's plane, moved onto the triangle.
SurfacePoint meet_loaded(SurfaceTable table, WorldTriangle triangle, Placement placed, dvec3 origin, dvec3 direction) {
  dvec3 from_v0 = origin - triangle.v0;
  dvec3 p = cross(direction, triangle.e2);
  dvec3 q = cross(from_v0, triangle.e1);
  double determinant = dot(triangle.e1, p);
  dvec2 met = dvec2(dot(from_v0, p) / determinant, dot(direction, q) / determinant);
  bool is_refined = (placed.traits & kIsRefined) != 0u;
  dvec2 on = onto_triangle(met);
  dvec2 at = is_refined ? onto_refined(table, met, triangle, origin, direction) : on;

  SurfacePoint point;
  point.position = triangle.v0 + at.x * triangle.e1 + at.y * triangle.e2;
  point.to_viewer = unit_or(-direction, dvec3(0.0lf, 0.0lf, 1.0lf));
  bool against_winding = dot(triangle.normal, point.to_viewer) < 0.0lf;
  point.offset = max(triangle.offset, rounding_at(table, point.position));
  if (is_refined) point.offset = min(point.offset, refined_offset(table, point.position));
  point.geometric_normal = against_winding ? -triangle.normal : triangle.normal;
  point.inside = against_winding != ((placed.traits & kSwapsHandedness) != 0u);
  dvec3 weights = dvec3(1.0lf - on.x - on.y, on.x, on.y);
  dvec3 smooth_normal = unit_or(weights.x * triangle.normals[0] + weights.y * triangle.normals[1] + weights.z * triangle.normals[2],
                                triangle.normal);
  double side = dot(smooth_normal, point.geometric_normal) < 0.0lf ? -1.0lf : 1.0lf;
  point.shading_normal = side * smooth_normal;

  point.lift = dvec3(0.0lf);
  if (table.lifts != 0u) {
    dvec3 in_triangle = weights.y * triangle.e1 + weights.z * triangle.e2;
    dvec3 from_corner[3] = dvec3[](in_triangle, in_triangle - triangle.e1, in_triangle - triangle.e2);
    for (int i = 0; i < 3; ++i) {
      dvec3 normal = side * triangle.normals[i];
      point.lift -= weights[i] * min(0.0lf, dot(from_corner[i], normal)) * normal;
    }
  }
  dvec3 beside = dvec3(1.0lf - at.x - at.y, at.x, at.y);
  for (int set = 0; set < 2; ++set) {
    point.uv[set] = uint64_t(placed.uvs[set]) != 0ul ? vec2(uv_of(placed.uvs[set], triangle.corners, beside)) : vec2(0.0);
  }
  point.color = dvec4(1.0lf);
  if (uint64_t(placed.colors) != 0ul) {
    point.color = weights.x * dvec4(placed.colors.vectors[triangle.corners.x]) +
                  weights.y * dvec4(placed.colors.vectors[triangle.corners.y]) +
                  weights.z * dvec4(placed.colors.vectors[triangle.corners.z]);
  }
  point.surface = triangle.surface;
  point.material = placed.material;
  point.layer = layer_of(placed, triangle.placement, triangle.index, point.inside);
  point.tangent = dvec3(0.0lf);
  point.bitangent = dvec3(0.0lf);
  if ((placed.traits & kNeedsTangents) != 0u) add_tangents(placed, triangle, weights, point);
  return point;
}

SurfacePoint meet_surface(SurfaceTable table, uint surface, dvec3 origin, dvec3 direction) {
  WorldTriangle triangle = load_triangle(table, surface);
  Placement placed = table.placements.placements[triangle.placement];
  return meet_loaded(table, triangle, placed, origin, direction);
}
