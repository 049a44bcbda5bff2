// All that gives light in a scene, as gpu/light/gpu_lights.h lays it out: rt/lights/light_sampler.h. Lights are numbered: punctual
// ones, triangles, the environment.
// Needs light_tree.glsl, punctual_lights.glsl, environment.glsl and triangle_lights.glsl, and what they need.

layout(buffer_reference, scalar) readonly buffer LightMedia {
  dvec3 absorption[];  // two of a light: Media of media.glsl
};

layout(buffer_reference, scalar) readonly buffer Lights {
  PunctualLights punctual;
  TriangleLights triangles;
  Environments environment;
  Materials materials;
  LightTree tree;
  LightNumbers in_tree;  // light of each of the tree's
  LightNumbers outside;  // directional lights, the headlight, the environment
  Sums outside_sums;     // of their irradiance
  Sums power_sums;
  LightMedia media;  // of every light but the environment
  dvec3 background;
  dvec3 lit_center;  // of a sphere about the scene
  double lit_radius;
  uint punctual_count;
  uint triangles_count;
  uint enumerated;
  uint outside_count;
  uint first_triangle;  // of the tree's lights; triangles come last, in order
  uint power_sums_count;
  uint has_environment;
  uint has_media;
};

struct ChosenLight {
  uint number;
  double probability;
  double rest;  // of the random number, for lights outside the tree
};

uint enumerated_lights(Lights lights) {
  return lights.enumerated;
}

// Whether every sample of enumerated light i is the same.
bool enumerated_is_fixed(Lights lights, uint i) {
  return is_fixed(lights.punctual.lights[i]);
}

// Weight is zero where it does not reach.
LightSample sample_enumerated(Lights lights, uint i, dvec3 position, View view, dvec2 u) {
  return sample_punctual(lights.punctual.lights[i], position, view, u);
}

// Whether there are lights beside the enumerated ones.
bool has_tree(Lights lights) {
  return lights.tree.nodes_count > 0u || lights.outside_count > 0u;
}

uint environment_number(Lights lights) {
  return lights.punctual_count + lights.triangles_count;
}

// How often a light outside the tree is chosen.
double outside_fraction(Lights lights, dvec3 position, dvec3 normal) {
  if (lights.outside_count == 0u) return 0.0lf;
  LightTree tree = lights.tree;
  double from_tree = tree.nodes_count == 0u ? 0.0lf : tree_importance(tree, position, normal);
  if (!(from_tree > 0.0lf)) return 1.0lf;
  double from_outside = lights.outside_sums.sums[lights.outside_count - 1u];
  return clamp(from_outside / (from_outside + from_tree), 0.1lf, 0.9lf);
}

bool choose_any_light(Lights lights, dvec3 position, dvec3 normal, double u, out ChosenLight chosen) {
  chosen = ChosenLight(0u, 0.0lf, 0.0lf);
  double fraction = outside_fraction(lights, position, normal);
  if (u < fraction) {
    Sums sums = lights.outside_sums;
    DiscreteSample picked = sample_discrete(sums, 0u, lights.outside_count, u / fraction);
    chosen = ChosenLight(lights.outside.numbers[picked.index], fraction * picked.probability, picked.rest);
    return true;
  }
  if (!(fraction < 1.0lf)) return false;
  LightTree tree = lights.tree;
  TreeChoice choice;
  if (!choose_light(tree, position, normal, (u - fraction) / (1.0lf - fraction), choice)) return false;
  chosen = ChosenLight(lights.in_tree.numbers[choice.light], (1.0lf - fraction) * choice.probability, 0.0lf);
  return true;
}

LightSample sample_environment_light(Environment map, dvec3 normal, double rest, dvec2 u) {
  LightSample made = no_light();
  dvec3 direction;
  if (!sample_environment(map, normal, rest, u, direction)) return made;
  made.to_light = direction;
  made.distance = kInfinity;
  DirectionalRadiance seen = evaluate_environment(map, direction, normal);
  made.pdf = seen.pdf;
  if (made.pdf > 0.0lf) made.weight = seen.radiance / made.pdf;
  return made;
}

// A sample of one of the lights that are not enumerated, chosen by what it may give to a surface at `position` with `normal`,
// which is zero where light comes from all sides. False where no light reaches it.
bool sample_lights(Lights lights, dvec3 position, dvec3 normal, View view, double choice, dvec2 u, out LightSample light) {
  light = no_light();
  ChosenLight chosen;
  if (!choose_any_light(lights, position, normal, choice, chosen)) return false;
  if (chosen.number < lights.punctual_count) {
    light = sample_punctual(lights.punctual.lights[chosen.number], position, view, u);
  } else if (chosen.number < environment_number(lights)) {
    TriangleLight triangle = lights.triangles.lights[chosen.number - lights.punctual_count];
    Materials materials = lights.materials;
    light = sample_triangle(materials, triangle, position, u);
  } else {
    light = sample_environment_light(lights.environment.environment, normal, chosen.rest, u);
  }
  light.weight /= chosen.probability;
  light.pdf *= chosen.probability;
  double weight = brightness_of(light.weight);
  return weight > 0.0lf && is_finite(weight);
}

// Per solid angle: the density with which sample_lights() picks the direction to a point of an emitting surface. 0 for
// surfaces that do not emit.
double surface_pdf(Lights lights, dvec3 position, dvec3 normal, uint surface, dvec3 hit_position) {
  TriangleLights triangles = lights.triangles;
  LightTree tree = lights.tree;
  uint triangle;
  if (!find_triangle(triangles, lights.triangles_count, surface, triangle)) return 0.0lf;
  double in_tree = 1.0lf - outside_fraction(lights, position, normal);
  double probability = in_tree * light_probability(tree, position, normal, lights.first_triangle + triangle);
  if (!(probability > 0.0lf)) return 0.0lf;
  return triangle_pdf(triangles.lights[triangle], position, hit_position) * probability;
}

// Radiance from outside the scene along `direction`: the environment, or the background where there is none.
dvec3 environment_radiance(Lights lights, dvec3 direction) {
  if (lights.has_environment == 0u) return lights.background;
  return environment_light(lights.environment.environment, direction);
}

double environment_pdf(Lights lights, dvec3 position, dvec3 normal, dvec3 direction) {
  uint count = lights.outside_count;
  if (count == 0u || lights.outside.numbers[count - 1u] != environment_number(lights)) return 0.0lf;
  double before = count > 1u ? lights.outside_sums.sums[count - 2u] : 0.0lf;
  double sum = lights.outside_sums.sums[count - 1u];
  double probability = outside_fraction(lights, position, normal) * ((sum - before) / sum);
  return evaluate_environment(lights.environment.environment, direction, normal).pdf * probability;
}
