// Triangles that emit: rt/lights/triangle_lights.h, but for coated ones.
// Needs punctual_lights.glsl and materials.glsl, and what they need.

struct TriangleLight {
  dvec3 v0;
  dvec3 e1;
  dvec3 e2;
  dvec3 normal;  // unit length; of one that emits from its front alone, on that side
  double area;   // m^2
  double offset;
  vec2 uv[2][3];  // set by set, of the corners; 0 where the mesh has none
  vec3 alpha;     // of the corners' colors
  uint has_colors;
  uint material;
  uint surface;
  uint two_sided;
  uint padding;
};
layout(buffer_reference, scalar) readonly buffer TriangleLights {
  TriangleLight lights[];
};

// A triangle seen from a point, as a part of the unit sphere.
struct SphericalTriangle {
  dvec3 a;  // unit length, to the corners
  dvec3 b;
  dvec3 c;
  double solid_angle;
  double alpha;        // the inner angle at a
  double below_cos_c;  // 1 - cos of the arc from a to b
};

const double kMinSolidAngle = 1e-6lf;
const double kMinSine = 1e-4lf;

// The part of `v` that is perpendicular to `axis`, at unit length.
dvec3 perpendicular(dvec3 v, dvec3 axis) {
  return normalize(v - dot(v, axis) * axis);
}

SphericalTriangle spherical_triangle(dvec3 position, dvec3 v0, dvec3 e1, dvec3 e2) {
  SphericalTriangle seen = SphericalTriangle(dvec3(0.0lf), dvec3(0.0lf), dvec3(0.0lf), 0.0lf, 0.0lf, 0.0lf);
  dvec3 to_a = v0 - position;
  dvec3 to_b = to_a + e1;
  dvec3 to_c = to_a + e2;
  double la = length(to_a);
  double lb = length(to_b);
  double lc = length(to_c);
  double product = la * lb * lc;
  if (!(product > 0.0lf) || !is_finite(product)) return seen;
  seen.a = to_a / la;
  seen.b = to_b / lb;
  seen.c = to_c / lc;
  double determinant = abs(dot(to_a, cross(e1, e2))) / product;
  double sum = 1.0lf + dot(seen.a, seen.b) + dot(seen.b, seen.c) + dot(seen.c, seen.a);
  seen.solid_angle = 2.0lf * arc_tangent_of(determinant, sum);
  dvec3 normal_ab = cross(to_a, e1);
  dvec3 normal_ac = cross(to_a, e2);
  seen.alpha = arc_tangent_of(length(cross(normal_ab, normal_ac)), dot(normal_ab, normal_ac));
  double sine2 = dot(normal_ab, normal_ab) / (la * la * lb * lb);
  double cosine = dot(seen.a, seen.b);
  seen.below_cos_c = cosine > 0.0lf ? sine2 / (1.0lf + cosine) : 1.0lf - cosine;
  return seen;
}

bool can_sample(SphericalTriangle seen) {
  return seen.solid_angle >= kMinSolidAngle && sine_of(seen.alpha) > kMinSine && seen.below_cos_c < 2.0lf - 1e-6lf;
}

// A direction of unit length, uniform over the solid angle; needs can_sample().
dvec3 sample_spherical_triangle(SphericalTriangle seen, dvec2 u) {
  // A smaller triangle with the part u.x of the area, cut off by the arc from b to a point d on the arc from a to c.
  double s = u.x * seen.solid_angle;
  dvec2 alpha = circle_at(seen.alpha);
  dvec2 rest = circle_at(seen.alpha - s);
  double sin_phi = rest.y;
  double cos_phi = -rest.x;
  double sin_half = sine_of(0.5lf * s);
  dvec2 between = circle_at(seen.alpha - 0.5lf * s);
  double k1 = -2.0lf * between.y * sin_half;  // cos alpha + cos phi
  double k2 = -2.0lf * between.x * sin_half + alpha.y * seen.below_cos_c;
  double cos_ad = clamp((k2 + (k2 * cos_phi - k1 * sin_phi) * alpha.x) / ((k2 * sin_phi + k1 * cos_phi) * alpha.y), -1.0lf,
                        1.0lf);
  dvec3 d = cos_ad * seen.a + sqrt((1.0lf - cos_ad) * (1.0lf + cos_ad)) * perpendicular(seen.c, seen.a);
  // A point of the arc from b to d, uniform in the cosine.
  double bd = length(d - seen.b);
  double below = u.y * 0.5lf * bd * bd;  // 1 - cos
  if (!(below > 0.0lf)) return seen.b;
  double across = sqrt(below * (2.0lf - below));
  return normalize((1.0lf - below) * seen.b + across * perpendicular(d, seen.b));
}

// Whether a point lies where it emits to.
bool shines_on(TriangleLight triangle, dvec3 position) {
  return triangle.two_sided != 0u || dot(position - triangle.v0, triangle.normal) > 0.0lf;
}

double sides_of(TriangleLight triangle) {
  return triangle.two_sided != 0u ? 2.0lf : 1.0lf;
}

// Where the direction meets the triangle's plane, moved onto the triangle.
dvec2 met_at(TriangleLight triangle, dvec3 position, dvec3 direction) {
  dvec3 from_v0 = position - triangle.v0;
  dvec3 p = cross(direction, triangle.e2);
  double determinant = dot(triangle.e1, p);
  dvec2 at = dvec2(dot(from_v0, p) / determinant, dot(direction, cross(from_v0, triangle.e1)) / determinant);
  if (!is_finite(at.x) || !is_finite(at.y)) return dvec2(1.0lf / 3.0lf);
  at = max(at, dvec2(0.0lf));
  double sum = at.x + at.y;
  return sum > 1.0lf ? at / sum : at;
}

dvec2 uniform_in_triangle(dvec2 u) {
  double root = sqrt(1.0lf - u.x);
  return dvec2(1.0lf - root, root * u.y);
}

// Per solid angle, of a point uniform over the area; 0 when it is seen edge-on.
double area_pdf(TriangleLight triangle, dvec3 to_point) {
  double distance_m = length(to_point);
  if (!(distance_m > 0.0lf)) return 0.0lf;
  double cosine = abs(dot(triangle.normal, to_point / distance_m));
  double pdf = distance_m * distance_m / (triangle.area * cosine);
  return cosine > 0.0lf && is_finite(pdf) ? pdf : 0.0lf;
}

vec2 corner_uv(TriangleLight triangle, uint set, dvec2 at) {
  if (set > 1u) return vec2(0.0);
  precise dvec2 uv = (1.0lf - at.x - at.y) * dvec2(triangle.uv[set][0]) + at.x * dvec2(triangle.uv[set][1]) +
                     at.y * dvec2(triangle.uv[set][2]);
  return vec2(uv);
}

// How much of the surface is there: what is cut out emits nothing.
double triangle_coverage(Materials materials, TriangleLight triangle, dvec2 at) {
  if (materials.all.items[triangle.material].alpha_mode == kOpaque) return 1.0lf;
  dvec3 corners = dvec3(triangle.alpha);
  double alpha = 1.0lf;
  if (triangle.has_colors != 0u) alpha = (1.0lf - at.x - at.y) * corners.x + at.x * corners.y + at.y * corners.z;
  vec2 uv[2] = vec2[](corner_uv(triangle, 0u, at), corner_uv(triangle, 1u, at));
  return evaluate_alpha(materials, triangle.material, uv, alpha);
}

// What leaves the triangle; `at`: along its edges.
dvec3 triangle_radiance(Materials materials, TriangleLight triangle, dvec2 at) {
  dvec3 radiance = dvec3(materials.all.items[triangle.material].emissive);
  TextureRef reference = materials.all.items[triangle.material].textures[kEmissiveTexture];
  if (is_present(reference)) {
    dvec2 uv = transformed_uv(reference, corner_uv(triangle, reference.uv_set, at));
    Textures textures = materials.textures;
    radiance *= sample_texture(textures, uint(reference.texture), kSrgb, uv).rgb;
  }
  return radiance * triangle_coverage(materials, triangle, at);
}

// The triangle with this surface id, if it emits.
bool find_triangle(TriangleLights triangles, uint count, uint surface, out uint found) {
  uint low = 0u;
  uint high = count;
  while (low < high) {
    uint at = (low + high) >> 1;
    if (triangles.lights[at].surface < surface) {
      low = at + 1u;
    } else {
      high = at;
    }
  }
  found = low;
  return low < count && triangles.lights[low].surface == surface;
}

LightSample sample_triangle(Materials materials, TriangleLight triangle, dvec3 position, dvec2 u) {
  LightSample made = no_light();
  if (!shines_on(triangle, position)) return made;
  SphericalTriangle seen = spherical_triangle(position, triangle.v0, triangle.e1, triangle.e2);
  bool by_angle = can_sample(seen);
  dvec2 at = by_angle ? met_at(triangle, position, sample_spherical_triangle(seen, u)) : uniform_in_triangle(u);
  dvec3 goal = triangle.v0 + at.x * triangle.e1 + at.y * triangle.e2;
  dvec3 to_goal = goal - position;
  double distance_m = length(to_goal);
  if (!(distance_m > 0.0lf) || !is_finite(distance_m)) return made;
  made.goal = goal;
  made.distance = distance_m;
  made.to_light = to_goal / distance_m;
  made.pdf = by_angle ? 1.0lf / seen.solid_angle : area_pdf(triangle, to_goal);
  made.offset = triangle.offset;
  if (made.pdf > 0.0lf) made.weight = triangle_radiance(materials, triangle, at) / made.pdf;
  return made;
}

// Per solid angle: the density with which sample_triangle() picks the direction to `point` of the triangle.
double triangle_pdf(TriangleLight triangle, dvec3 position, dvec3 point) {
  if (!shines_on(triangle, position)) return 0.0lf;
  SphericalTriangle seen = spherical_triangle(position, triangle.v0, triangle.e1, triangle.e2);
  return can_sample(seen) ? 1.0lf / seen.solid_angle : area_pdf(triangle, point - position);
}
