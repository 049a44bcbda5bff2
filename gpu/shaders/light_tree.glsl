// Chooses among many lights by what they may give to a point: rt/lights/light_tree.h.
// Needs reals.glsl.

layout(buffer_reference, scalar) readonly buffer LightNumbers {
  uint numbers[];
};

struct LightNode {
  dvec3 center;
  double radius;  // of the sphere about the box
  dvec3 half_box;
  double reach;
  dvec3 axis;
  double strength;
  double cos_spread;
  double sin_spread;
  double cos_emission;
  uint two_sided;
  uint second;  // the other child; the first one follows its parent. 0: a leaf
  uint light;   // of a leaf
  uint padding;
};
layout(buffer_reference, scalar) readonly buffer LightNodes {
  LightNode nodes[];
};

struct LightTree {
  LightNodes nodes;  // in depth-first order
  LightNumbers leaf_of;
  uint nodes_count;
  uint padding;
};

struct TreeChoice {
  uint light;
  double probability;
};

// An angle's cosine and sine.
dvec2 angle_of_cosine(double cosine) {
  return dvec2(cosine, sqrt(max(0.0lf, 1.0lf - cosine * cosine)));
}

// max(0, a - b).
dvec2 angle_difference(dvec2 a, dvec2 b) {
  if (a.x >= b.x) return dvec2(1.0lf, 0.0lf);
  return dvec2(a.x * b.x + a.y * b.y, a.y * b.x - a.x * b.y);
}

double node_importance(LightNodes nodes, uint index, dvec3 position, dvec3 normal) {
  LightNode node = nodes.nodes[index];
  dvec3 to_center = node.center - position;
  double distance_m = length(to_center);
  if (!(distance_m + node.radius > 0.0lf) || !is_finite(distance_m + node.radius)) return 0.0lf;
  if (node.reach > 0.0lf &&
      length(max(abs(to_center) - node.half_box, dvec3(0.0lf))) > node.reach * (1.0lf + 1e-9lf)) {
    return 0.0lf;
  }
  double cosine = 1.0lf;
  if (distance_m > node.radius) {
    // Every angle may be less by that under which the lights are seen.
    double near = 1.0lf / distance_m;
    double sine = node.radius * near;
    dvec2 seen = dvec2(sqrt((distance_m - node.radius) * near * (1.0lf + sine)), sine);
    double off_axis = -dot(node.axis, to_center) * near;
    dvec2 from_axis = angle_of_cosine(node.two_sided != 0u ? abs(off_axis) : off_axis);
    dvec2 leaving = angle_difference(angle_difference(from_axis, dvec2(node.cos_spread, node.sin_spread)), seen);
    if (leaving.x <= node.cos_emission) return 0.0lf;
    // Rounding at grazing angles must not shut out a light.
    cosine = max(leaving.x, 1e-3lf);
    if (normal != dvec3(0.0lf)) {
      dvec2 arriving = angle_difference(angle_of_cosine(dot(normal, to_center) * near), seen);
      if (!(arriving.x > 0.0lf)) return 0.0lf;
      cosine *= arriving.x;
    }
  }
  double nearest = max(distance_m, node.radius);
  double importance = node.strength * cosine / (nearest * nearest);
  return is_finite(importance) ? min(importance, 1e300lf) : 1e300lf;
}

// Of all lights together; the tree must not be empty.
double tree_importance(LightTree tree, dvec3 position, dvec3 normal) {
  return node_importance(tree.nodes, 0u, position, normal);
}

// With which the first of a node's children is chosen; -1 where neither gives anything.
double fraction_of_first(LightTree tree, uint node, dvec3 position, dvec3 normal) {
  double first = node_importance(tree.nodes, node + 1u, position, normal);
  double second = node_importance(tree.nodes, tree.nodes.nodes[node].second, position, normal);
  double sum = first + second;
  return sum > 0.0lf ? first / sum : -1.0lf;
}

// False where no light reaches the point.
bool choose_light(LightTree tree, dvec3 position, dvec3 normal, double u, out TreeChoice choice) {
  choice = TreeChoice(0u, 1.0lf);
  if (tree.nodes_count == 0u || !(tree_importance(tree, position, normal) > 0.0lf)) return false;
  uint node = 0u;
  uint second = tree.nodes.nodes[0].second;
  while (second != 0u) {
    double fraction = fraction_of_first(tree, node, position, normal);
    if (fraction < 0.0lf) return false;
    if (u < fraction) {
      u /= fraction;
      choice.probability *= fraction;
      ++node;
    } else {
      u = min((u - fraction) / (1.0lf - fraction), 0.99999999999999988898lf);
      choice.probability *= 1.0lf - fraction;
      node = second;
    }
    second = tree.nodes.nodes[node].second;
  }
  choice.light = tree.nodes.nodes[node].light;
  return true;
}

// With which choose_light() finds `light`. Nodes are in depth-first order, so the leaf's number says on which side it is.
double light_probability(LightTree tree, dvec3 position, dvec3 normal, uint light) {
  if (!(tree_importance(tree, position, normal) > 0.0lf)) return 0.0lf;
  uint leaf = tree.leaf_of.numbers[light];
  double probability = 1.0lf;
  uint node = 0u;
  while (node != leaf) {
    double fraction = fraction_of_first(tree, node, position, normal);
    if (fraction < 0.0lf) return 0.0lf;
    uint second = tree.nodes.nodes[node].second;
    bool is_first = leaf < second;
    probability *= is_first ? fraction : 1.0lf - fraction;
    node = is_first ? node + 1u : second;
  }
  return probability;
}
