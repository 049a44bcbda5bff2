// Vertices of paths from the eye, and which lobes are followed from them: rt/passes/path_vertex.cpp.
// Needs sampler.glsl, surfaces.glsl, materials.glsl, media.glsl, bsdf.glsl, reflection_terms.glsl.

const double kMinThroughput = 1.0lf / 65536.0lf;
const uint kChoosingDepth = 2u;

double next_one(inout Sampler random) {
  return double(one(random)) / 4294967296.0lf;
}

// What decides after so many bounces from the eye.
dvec2 next_two(inout Sampler random, uint bounces) {
  return dvec2(bounces == 0u ? two_with_pixel(random) : two(random)) / 4294967296.0lf;
}

// A vertex that is not yet shaded: the surface that a ray met.
struct FoundVertex {
  dvec3 origin;  // of the ray
  dvec3 direction;
  dvec3 throughput;
  Media media;  // on the viewer's side
  dvec3 previous_position;
  dvec3 previous_normal;
  double previous_pdf;  // 0: the direction was the only one
  Sampler random;
  uint surface;
  uint depth;
};

struct PathVertex {
  SurfacePoint surface;
  MaterialPoint material;
  Bsdf bsdf;
  dvec3 throughput;
  Media media;
  Sampler random;
  double lobe_weights[kLobes];  // 0 where no ray follows the lobe
  bool may_follow[kLobes];
  uint depth;
};

// What all vertices are followed by.
struct PathLimits {
  double glossy_cutoff;
  uint max_depth;
  uint followed;  // bits: lobes that a pass follows
};

double in_single(double x) {
  return double(float(x));
}

// The factor of a path whose throughput is so bright; 0 where it ends.
double roulette_weight(double brightness, inout Sampler random) {
  if (!(brightness < kMinThroughput)) return 1.0lf;
  double chance = brightness / kMinThroughput;
  return chance > 0.0lf && next_one(random) < chance ? 1.0lf / chance : 0.0lf;
}

bool follows_lobe(PathLimits limits, Bsdf bsdf, uint lobe) {
  return ((limits.followed >> lobe) & 1u) != 0u && is_followed(bsdf, lobe, limits.glossy_cutoff);
}

// Whether a ray for each channel goes through a surface that disperses.
bool splits_channels(PathVertex point) {
  return !point.surface.inside && point.depth < kChoosingDepth && disperses(point.material) &&
         point.material.roughness < kDeltaRoughness && carries_channels(point.throughput);
}

// choose_followed() and what finish_vertex() does for plain surfaces: all lobes, and past the first surfaces one of them by chance.
void choose_followed(PathLimits limits, inout PathVertex point) {
  double bright[kLobes];
  double sum = 0.0lf;
  uint choices = 0u;
  for (uint lobe = 0u; lobe < kLobes; ++lobe) {
    point.lobe_weights[lobe] = 0.0lf;
    point.may_follow[lobe] = false;
    bright[lobe] = 0.0lf;
  }
  if (point.depth >= limits.max_depth) return;
  for (uint lobe = 0u; lobe < kLobes; ++lobe) {
    if (!follows_lobe(limits, point.bsdf, lobe)) continue;
    bright[lobe] = largest(point.throughput * bsdf_weight(point.bsdf, lobe));
    point.may_follow[lobe] = bright[lobe] > 0.0lf;
    point.lobe_weights[lobe] = in_single(roulette_weight(bright[lobe], point.random));
    sum += bright[lobe];
    choices += point.may_follow[lobe] ? 1u : 0u;
  }
  if (point.depth < kChoosingDepth || choices < 2u) return;
  if (!is_extended(point.bsdf)) {
    double fraction = clamp(bright[kReflection] / (bright[kReflection] + bright[kTransmission]), 0.1lf, 0.9lf);
    bool reflects = next_one(point.random) < fraction;
    double kept = in_single(reflects ? 1.0lf / fraction : 1.0lf / (1.0lf - fraction));
    point.lobe_weights[kReflection] = in_single(reflects ? point.lobe_weights[kReflection] * kept : 0.0lf);
    point.lobe_weights[kTransmission] = in_single(reflects ? 0.0lf : point.lobe_weights[kTransmission] * kept);
    return;
  }
  const double kMinFraction = 0.1lf;
  double total = 0.0lf;
  for (uint lobe = 0u; lobe < kLobes; ++lobe) {
    if (point.may_follow[lobe]) total += bright[lobe] + kMinFraction * sum;
  }
  double target = min(next_one(point.random), 1.0lf - 1.0lf / 9007199254740992.0lf) * total;
  double before = 0.0lf;
  uint picked = kLobes;
  double chance = 0.0lf;
  for (uint lobe = 0u; lobe < kLobes; ++lobe) {
    if (!point.may_follow[lobe]) continue;
    double weight = bright[lobe] + kMinFraction * sum;
    // Rounding may lead past the last one: then it is the last with a chance.
    if (picked == kLobes || before <= target) {
      picked = lobe;
      chance = weight / total;
    }
    before += weight;
  }
  for (uint lobe = 0u; lobe < kLobes; ++lobe) {
    double kept = lobe == picked ? in_single(1.0lf / chance) : 0.0lf;
    point.lobe_weights[lobe] = in_single(point.lobe_weights[lobe] * kept);
  }
}

// start_vertex() and finish_vertex().
PathVertex make_vertex(SurfaceTable surfaces, Materials materials, PathLimits limits, FoundVertex found) {
  PathVertex point;
  point.surface = meet_surface(surfaces, found.surface, found.origin, found.direction);
  point.material = evaluate_material(materials, point.surface);
  point.media = found.media;
  point.depth = found.depth;
  point.random = found.random;
  // The eye's first stretch is in what the eye is in; further ones may end on the inside of a wall.
  if (found.depth == 0u) {
    point.throughput = found.throughput * transmittance(found.media.here, distance(found.previous_position, point.surface.position));
  } else {
    double metres = distance(point.surface.position, found.previous_position);
    point.throughput = found.throughput;
    if (metres > 0.0lf) point.throughput *= transmittance_to(found.media, point.surface, point.material, metres);
  }
  if (disperses(point.material) && !splits_channels(point) &&
      !(shares_directions(point.material) && carries_channels(point.throughput))) {
    choose_channel(point.material, point.throughput, next_one(point.random));
  }
  point.bsdf = make_bsdf(point.material, point.surface, false);
  choose_followed(limits, point);
  return point;
}
