// Trees of boxes, as gpu/bvh.h builds them.

struct BvhNode {
  vec3 low;
  uint first;  // inner nodes: the first child, the second one beside it; leaves: the first item
  vec3 high;
  uint items;  // 0: an inner node
};
layout(buffer_reference, scalar) readonly buffer BvhNodes {
  BvhNode nodes[];
};
layout(buffer_reference, scalar) readonly buffer Indices {
  uint indices[];
};
const uint kMaxBvhDepth = 48u;

// A ray as boxes are tested against: in single precision, so boxes count as `slack` wider on all sides. It starts near them,
// however far off the eye is: there single precision has the digits.
struct BoxRay {
  vec3 origin;
  vec3 inverse;  // of the direction's components, none of them 0
  float slack;
  double start;  // multiple of the direction by which the origin was moved
  float near;    // boxes that end before are left out; a multiple from there on
};

// `largest`: of the coordinates of all boxes it will be tested against.
BoxRay make_box_ray(dvec3 origin, dvec3 direction, float largest) {
  BoxRay ray;
  double squared = dot(direction, direction);
  double reach = 2.0 * double(largest) / sqrt(squared);  // they lie within sqrt(3) times the largest of the middle
  ray.start = max(dot(-origin, direction) / squared - reach, double(0.0));
  ray.near = 0.0;
  ray.origin = vec3(origin + ray.start * direction);
  vec3 along = vec3(direction);
  for (int axis = 0; axis < 3; ++axis) {
    if (abs(along[axis]) < 1e-30) along[axis] = along[axis] < 0.0 ? -1e-30 : 1e-30;
  }
  ray.inverse = 1.0 / along;
  // Four units in the last place of what is subtracted: the origin's rounding, the difference's, the quotient's.
  vec3 size = abs(ray.origin);
  ray.slack = 4.8e-7 * (max(size.x, max(size.y, size.z)) + largest);
  return ray;
}

// Where the ray enters a box before `limit`, from its start on; negative: nowhere.
float enters(BoxRay ray, BvhNode node, float limit) {
  vec3 a = (node.low - ray.slack - ray.origin) * ray.inverse;
  vec3 b = (node.high + ray.slack - ray.origin) * ray.inverse;
  vec3 first = min(a, b);
  vec3 last = max(a, b);
  float near = max(max(first.x, first.y), max(first.z, ray.near));
  float far = min(min(last.x, last.y), min(last.z, limit));
  return near <= far ? near : -1.0;
}
