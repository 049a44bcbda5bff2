// Keys by one ray through each pixel's centre: those of PrimaryRays (rt/trace/primary_rays.h), whose key_along this repeats
// step by step, so that depths are equal to the bit where the same triangle is met.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "scene.glsl"
#include "view.glsl"

layout(buffer_reference, scalar) writeonly buffer Keys {
  uint64_t keys[];
};
layout(push_constant, scalar) uniform Constants {
  Keys found_keys;
  Views views;
  SceneTrees scene;
};

const uint64_t kUnfinished = ~0ul;  // of no surface: its depth is no number

precise dvec3 exact_cross(dvec3 a, dvec3 b) {
  precise dvec3 c = dvec3(a.y * b.z - b.y * a.z, a.z * b.x - b.z * a.x, a.x * b.y - b.x * a.y);
  return c;
}
precise double exact_dot(dvec3 a, dvec3 b) {
  precise dvec3 products = a * b;
  precise double sum = products.x + products.y + products.z;
  return sum;
}
precise dvec3 exact_linear(dmat4x3 matrix, dvec3 v) {
  precise dvec3 image = matrix[0] * v.x + matrix[1] * v.y + matrix[2] * v.z;
  return image;
}

struct Found {
  uint64_t key;
  double along;  // metres from the eye along the view's axis
};

// How far off a triangle its barycentric coordinates may be: about as far as Embree's rounding has it, so that a ray through the
// edge between two triangles meets both, of which the one with the lower id stays; and what rounding may do to them, more where
// the place is far away for the triangle's size, or seen nearly edge-on, so that no ray slips through between two.
double edge_of(dvec3 from_v0, dvec3 direction, dvec3 e1, dvec3 e2, double determinant) {
  double longest = max(length(e1), length(e2));
  return min(5.9604645e-8 + 1.8e-15 * length(from_v0) * length(direction) * longest / abs(determinant), double(1e-6));
}

void meet(View view, Ray ray, Instance instance, uint triangle, inout Found found) {
  uvec3 corners = instance.triangles.triangles[triangle];
  dvec3 p0 = dvec3(instance.positions.positions[corners.x]);
  precise dvec3 d1 = dvec3(instance.positions.positions[corners.y]) - p0;
  precise dvec3 d2 = dvec3(instance.positions.positions[corners.z]) - p0;
  precise dvec3 e1 = exact_linear(instance.to_world, d1);
  precise dvec3 e2 = exact_linear(instance.to_world, d2);
  precise dvec3 v0 = exact_linear(instance.to_world, p0) + (instance.to_world[3] - view.eye);

  precise dvec3 from_v0 = (ray.origin - view.eye) - v0;
  precise dvec3 p = exact_cross(ray.direction, e2);
  precise dvec3 q = exact_cross(from_v0, e1);
  precise double determinant = exact_dot(e1, p);
  if (double(instance.front) * determinant < 0.0) return;
  precise double u = exact_dot(from_v0, p) / determinant;
  precise double v = exact_dot(ray.direction, q) / determinant;
  double edge = edge_of(from_v0, ray.direction, e1, e2, determinant);
  if (!(u >= -edge && v >= -edge && u + v <= 1.0 + edge)) return;  // nor where the triangle is seen edge-on
  u = max(u, double(0.0));
  v = max(v, double(0.0));
  precise double sum = max(u + v, double(1.0));
  u = u / sum;
  v = v / sum;
  precise dvec3 place = v0 + u * e1 + v * e2;
  precise double along = -exact_dot(place, view.back);

  precise double reversed = view.orthographic != 0u
                                ? (view.far_distance - along) / (view.far_distance - view.near_distance)
                                : view.near_distance / along;
  float depth = float(reversed);
  if (!(depth > 0.0) || !(depth <= 1.0)) return;
  uint64_t key = (uint64_t(floatBitsToUint(depth)) << 32) | uint64_t(~(instance.first_surface + triangle));
  if (key > found.key) {
    found.key = key;
    found.along = along;
  }
}

// Up to where other surfaces may have as large a key: what rounds to the same depth, and what single precision adds.
// From the start of a box ray on.
float limit_of(View view, Found found, BoxRay boxes) {
  if (found.key == 0ul) return 3.0e38;
  double step = view.orthographic != 0u ? (view.far_distance - view.near_distance) * 2.4e-7 : double(0.0);
  return float(found.along + abs(found.along) * 1e-6 + step - boxes.start);
}

// Whether all was looked at: software devices end loops, in silence.
bool trace_mesh(View view, Ray ray, Instance instance, inout Found found) {
  BoxRay boxes = make_box_ray(instance.to_boxes * (ray.origin - instance.box_origin),
                              instance.to_boxes * ray.direction, instance.largest);
  uint stack[kMaxBvhDepth];
  uint open = 0u;
  uint at = 0u;
  if (enters(boxes, instance.nodes.nodes[0], limit_of(view, found, boxes)) < 0.0) return true;
  while (true) {
    BvhNode node = instance.nodes.nodes[at];
    if (node.items > 0u) {
      uint i = 0u;
      for (; i < node.items; ++i) meet(view, ray, instance, instance.items.indices[node.first + i], found);
      if (i < node.items) return false;
    } else {
      float limit = limit_of(view, found, boxes);
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
    if (open == 0u) return true;
    at = stack[--open];
  }
  return false;
}

bool trace_scene(View view, Ray ray, SceneTree tree, inout Found found) {
  if (tree.is_empty != 0u) return true;
  precise dvec3 origin = ray.origin - tree.center;
  BoxRay boxes = make_box_ray(origin, ray.direction, tree.largest);
  uint stack[kMaxBvhDepth];
  uint open = 0u;
  uint at = 0u;
  while (true) {
    BvhNode node = tree.nodes.nodes[at];
    bool meets = enters(boxes, node, limit_of(view, found, boxes)) >= 0.0;
    if (meets && node.items > 0u) {
      uint i = 0u;
      for (; i < node.items; ++i) {
        if (!trace_mesh(view, ray, tree.instances.instances[tree.items.indices[node.first + i]], found)) return false;
      }
      if (i < node.items) return false;
    } else if (meets) {
      float limit = limit_of(view, found, boxes);
      float a = enters(boxes, tree.nodes.nodes[node.first], limit);
      float b = enters(boxes, tree.nodes.nodes[node.first + 1u], limit);
      bool first_is_nearer = b < 0.0 || (a >= 0.0 && a <= b);
      stack[open++] = first_is_nearer ? node.first + 1u : node.first;
      at = first_is_nearer ? node.first : node.first + 1u;
      continue;
    }
    if (open == 0u) return true;
    at = stack[--open];
  }
  return false;
}

void main() {
  View view = views.view;
  uint64_t i = thread_index();
  if (i >= uint64_t(view.size.x) * view.size.y) return;
  uvec2 pixel = uvec2(uint(i) % view.size.x, uint(i) / view.size.x);
  Found found = Found(0ul, double(0.0));
  bool finished = trace_scene(view, view_ray(view, pixel), scene.tree, found);
  found_keys.keys[uint(i)] = finished ? found.key : kUnfinished;
}
