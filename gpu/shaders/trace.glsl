// Rays through a scene: which surface they meet first, and whether they meet any. Needs scene.glsl.

// What a ray has met and passed if it is sent once more from where it began: Passed of rt/trace/ray_scene.h, in metres.
struct Passed {
  double distance;
  uint surface;  // kNoSurface: nothing yet
  uint first_surface;  // of its instance
  double edge;  // nearer than that, triangles of one instance are met once: they share the edge there
};
const Passed kNothingPassed = Passed(0.0lf, kNoSurface, 0u, 0.0lf);

struct TracedRay {
  dvec3 origin;
  dvec3 direction;   // unit length
  double reach;      // metres
  bool meets_backs;  // of single-sided surfaces
  Passed passed;
};

struct NearestHit {
  double distance;  // metres; beyond it nothing matters
  uint surface;     // the lowest one of those at this distance in single precision
  uint first_surface;  // of its instance
};

// Whether the ray has that behind it already.
bool was_met(Passed passed, Instance instance, uint surface, double distance) {
  if (passed.surface == kNoSurface) return false;
  if (instance.first_surface == passed.first_surface) {
    return surface == passed.surface || distance <= passed.distance + passed.edge;
  }
  return float(distance) < float(passed.distance) ||
         (float(distance) == float(passed.distance) && surface < passed.surface);
}

// See edge_of() in keys.comp: a ray through the edge between two triangles meets both.
double traced_edge(dvec3 from_v0, dvec3 e1, dvec3 e2, double determinant) {
  double longest = max(length(e1), length(e2));
  return min(5.9604645e-8lf + 1.8e-15lf * length(from_v0) * longest / abs(determinant), 1e-6lf);
}

void meet_triangle(TracedRay ray, Instance instance, uint triangle, inout NearestHit hit) {
  uvec3 corners = instance.triangles.triangles[triangle];
  dvec3 p0 = dvec3(instance.positions.positions[corners.x]);
  dvec3 d1 = dvec3(instance.positions.positions[corners.y]) - p0;
  dvec3 d2 = dvec3(instance.positions.positions[corners.z]) - p0;
  dmat3 linear = dmat3(instance.to_world[0], instance.to_world[1], instance.to_world[2]);
  dvec3 e1 = linear * d1;
  dvec3 e2 = linear * d2;
  dvec3 from_v0 = (ray.origin - instance.to_world[3]) - linear * p0;
  dvec3 p = cross(ray.direction, e2);
  double determinant = dot(e1, p);
  if (!ray.meets_backs && double(instance.front) * determinant < 0.0lf) return;
  dvec3 q = cross(from_v0, e1);
  double u = dot(from_v0, p) / determinant;
  double v = dot(ray.direction, q) / determinant;
  double distance = dot(e2, q) / determinant;
  if (!(distance > 0.0lf && distance <= ray.reach)) return;
  double edge = traced_edge(from_v0, e1, e2, determinant);
  if (!(u >= -edge && v >= -edge && u + v <= 1.0lf + edge)) return;  // nor where the triangle is seen edge-on
  uint surface = instance.first_surface + triangle;
  if (was_met(ray.passed, instance, surface, distance)) return;
  bool is_level = float(distance) == float(hit.distance) && hit.surface != kNoSurface;
  if (is_level ? surface < hit.surface : distance < hit.distance) {
    hit.distance = distance;
    hit.surface = surface;
    hit.first_surface = instance.first_surface;
  }
}

// From the start of a box ray on; a little more than single precision may take off.
float traced_limit(NearestHit hit, BoxRay boxes) {
  if (isinf(hit.distance)) return 3.0e38;
  return float(hit.distance * 1.000001lf - boxes.start);
}

// Leaves out most of what the ray has passed.
void start_past(Passed passed, inout BoxRay boxes) {
  if (passed.surface != kNoSurface) boxes.near = max(float(passed.distance * 0.999999lf - boxes.start), 0.0);
}

void trace_instance(TracedRay ray, Instance instance, bool any, inout NearestHit hit) {
  BoxRay boxes = make_box_ray(instance.to_boxes * (ray.origin - instance.box_origin),
                              instance.to_boxes * ray.direction, instance.largest);
  start_past(ray.passed, boxes);
  uint stack[kMaxBvhDepth];
  uint open = 0u;
  uint at = 0u;
  if (enters(boxes, instance.nodes.nodes[0], traced_limit(hit, boxes)) < 0.0) return;
  while (true) {
    BvhNode node = instance.nodes.nodes[at];
    if (node.items > 0u) {
      for (uint i = 0u; i < node.items; ++i) {
        meet_triangle(ray, instance, instance.items.indices[node.first + i], hit);
      }
      if (any && hit.surface != kNoSurface) return;
    } else {
      float limit = traced_limit(hit, boxes);
      float a = enters(boxes, instance.nodes.nodes[node.first], limit);
      float b = enters(boxes, instance.nodes.nodes[node.first + 1u], limit);
      if (a >= 0.0 && b >= 0.0) {
        stack[open++] = a <= b ? node.first + 1u : node.first;
        at = a <= b ? node.first : node.first + 1u;
        continue;
      }
      if (a >= 0.0 || b >= 0.0) {
        at = a >= 0.0 ? node.first : node.first + 1u;
        continue;
      }
    }
    if (open == 0u) return;
    at = stack[--open];
  }
}

void trace_ray(SceneTree tree, TracedRay ray, bool any, inout NearestHit hit) {
  if (tree.is_empty != 0u) return;
  BoxRay boxes = make_box_ray(ray.origin - tree.center, ray.direction, tree.largest);
  start_past(ray.passed, boxes);
  uint stack[kMaxBvhDepth];
  uint open = 0u;
  uint at = 0u;
  while (true) {
    BvhNode node = tree.nodes.nodes[at];
    bool meets = enters(boxes, node, traced_limit(hit, boxes)) >= 0.0;
    if (meets && node.items > 0u) {
      for (uint i = 0u; i < node.items; ++i) {
        trace_instance(ray, tree.instances.instances[tree.items.indices[node.first + i]], any, hit);
      }
      if (any && hit.surface != kNoSurface) return;
    } else if (meets) {
      float limit = traced_limit(hit, boxes);
      float a = enters(boxes, tree.nodes.nodes[node.first], limit);
      float b = enters(boxes, tree.nodes.nodes[node.first + 1u], limit);
      bool first_is_nearer = b < 0.0 || (a >= 0.0 && a <= b);
      stack[open++] = first_is_nearer ? node.first + 1u : node.first;
      at = first_is_nearer ? node.first : node.first + 1u;
      continue;
    }
    if (open == 0u) return;
    at = stack[--open];
  }
}

// Its surface is kNoSurface where the ray meets nothing.
NearestHit closest_hit(SceneTree tree, TracedRay ray) {
  NearestHit hit = NearestHit(ray.reach, kNoSurface, 0u);
  trace_ray(tree, ray, false, hit);
  return hit;
}

uint closest_surface(SceneTree tree, TracedRay ray) {
  return closest_hit(tree, ray).surface;
}

bool is_blocked(SceneTree tree, TracedRay ray) {
  NearestHit hit = NearestHit(ray.reach, kNoSurface, 0u);
  trace_ray(tree, ray, true, hit);
  return hit.surface != kNoSurface;
}
