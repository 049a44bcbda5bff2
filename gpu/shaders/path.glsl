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
  uint followed;   // bounces by lobes that passes follow for themselves
  uint reached_by;  // bits: those below
};

// Of paths where rays gather light, or bring what photons tell (PathVertex of rt/passes/pass.h).
const uint kGathered = 1u;  // some ray on the way gathered light
const uint kCaustic = 2u;   // the last ray did not, from where light was gathered: caustic photons bring what lamps send that way
const uint kDiffusePath = 4u;  // the first ray did: what comes that way counts as diffuse

struct PathVertex {
  SurfacePoint surface;
  MaterialPoint material;
  Bsdf bsdf;
  dvec3 throughput;
  Media media;
  Sampler random;
  double lobe_weights[kLobes];  // 0 where no ray follows the lobe
  bool may_follow[kLobes];
  double gather_reach;  // metres from within which rays gather light, and photons bring what comes from further
  uint depth;
  uint followed;  // as FoundVertex has them
  uint reached_by;
};

// What all vertices are followed by.
struct PathLimits {
  double glossy_cutoff;
  double near;  // of photons, metres
  uint max_depth;
  uint followed;  // bits: lobes that a pass follows
  uint gathers;   // whether rays follow the others too: 0: no; 1: all the way; or kGathersPhotons
  uint padding;
};
const uint kGathersPhotons = 2u;  // of rays that gather, photons tell what comes from afar

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
  return !point.surface.inside && point.depth < kChoosingDepth && (point.reached_by & kGathered) == 0u && disperses(point.material) &&
         point.material.roughness < kDeltaRoughness && carries_channels(point.throughput);
}

// Whether a ray along the lobe gathers light: no pass follows it for itself.
bool gathers_lobe(PathLimits limits, Bsdf bsdf, uint lobe) {
  return limits.gathers != 0u && !follows_lobe(limits, bsdf, lobe);
}

// LightContext::leaves_caustics().
bool leaves_caustics(PathLimits limits, PathVertex point) {
  return limits.gathers == kGathersPhotons && (point.reached_by & kGathered) != 0u;
}

bool gathers_near(PathVertex point) {
  return is_finite(point.gather_reach);
}

// sample_discrete() of running sums.
uint pick_lobe(double sums[kLobes], double u, out double probability) {
  const double kBelowOne = 1.0lf - 1.0lf / 9007199254740992.0lf;
  double whole = sums[kLobes - 1u];
  double target = min(u, kBelowOne) * whole;
  // The product may round up to the whole sum: then the last one that adds to it.
  bool is_last = !(target < whole);
  uint picked = 0u;
  while (picked + 1u < kLobes && (is_last ? sums[picked] < whole : !(target < sums[picked]))) ++picked;
  probability = (sums[picked] - (picked > 0u ? sums[picked - 1u] : 0.0lf)) / whole;
  return picked;
}

// Where all lobes are followed: each from what the eye sees, and then one of them by chance.
void choose_lobes(PathLimits limits, inout PathVertex point) {
  const uint kMaxGathered = 256u;
  const uint kRouletteDepth = 3u;
  if (point.depth >= kMaxGathered) return;
  double sums[kLobes];
  double sum = 0.0lf;
  for (uint lobe = 0u; lobe < kLobes; ++lobe) {
    bool ends = lobe >= kCoat && !is_extended(point.bsdf);
    ends = ends || (point.followed >= limits.max_depth && follows_lobe(limits, point.bsdf, lobe));
    double bright = 0.0lf;
    if (point.depth == 0u) {
      point.may_follow[lobe] = !ends && bsdf_present(point.bsdf, lobe);
      point.lobe_weights[lobe] = point.may_follow[lobe] ? 1.0lf : 0.0lf;
    } else if (!ends) {
      bright = largest(point.throughput * bsdf_weight(point.bsdf, lobe));
      point.may_follow[lobe] = bright > 0.0lf;
    }
    sum += bright;
    sums[lobe] = sum;
  }
  if (!(sum > 0.0lf)) return;
  double chance = point.depth < kRouletteDepth ? 1.0lf : min(sum, 1.0lf);
  double u = next_one(point.random) / chance;
  if (!(u < 1.0lf)) return;
  double probability;
  uint picked = pick_lobe(sums, u, probability);
  point.lobe_weights[picked] = in_single(1.0lf / (probability * chance));
}

// choose_followed() and what finish_vertex() does for plain surfaces: all lobes, and past the first surfaces one of them by chance.
void choose_followed(PathLimits limits, inout PathVertex point) {
  double bright[kLobes];
  double sum = 0.0lf;
  uint choices = 0u;
  for (uint lobe = 0u; lobe < kLobes; ++lobe) bright[lobe] = 0.0lf;
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
  double sums[kLobes];
  double total = 0.0lf;
  for (uint lobe = 0u; lobe < kLobes; ++lobe) {
    if (point.may_follow[lobe]) total += bright[lobe] + kMinFraction * sum;
    sums[lobe] = total;
  }
  double chance;
  uint picked = pick_lobe(sums, next_one(point.random), chance);
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
  point.followed = found.followed;
  point.reached_by = found.reached_by;
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
  // Photons are not asked where a ray that gathers ends near its start.
  point.gather_reach = kInfinity;
  if (leaves_caustics(limits, point) && !(distance(point.surface.position, found.previous_position) < limits.near)) {
    point.gather_reach = limits.near;
  }
  for (uint lobe = 0u; lobe < kLobes; ++lobe) {
    point.lobe_weights[lobe] = 0.0lf;
    point.may_follow[lobe] = false;
  }
  if (limits.gathers != 0u) {
    choose_lobes(limits, point);
  } else {
    choose_followed(limits, point);
  }
  return point;
}
