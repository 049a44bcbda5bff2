// Photons go on from where they arrived: PhotonTracer::scatter.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "photon_kernel.glsl"
#include "adjoint_bsdf.glsl"

const uint kFirstBounces = 3u;

// How often a glossy lobe's direction is chosen about the true surface's normal: as far as the shading normal leans, as little
// lies beyond its horizon; more where much of the lobe may.
double chance_of_plain(SurfacePoint surface, dvec3 shading_normal, uint lobe) {
  if (lobe == kDiffuse || lobe == kDiffuseTransmission) return 1.0lf;
  if (lobe == kTransmission) return 0.25lf;
  dvec3 geometric = surface.geometric_normal;
  dvec3 reflected = 2.0lf * dot(surface.to_viewer, geometric) * geometric - surface.to_viewer;
  if (!(dot(reflected, shading_normal) > 0.0lf)) return 0.5lf;
  return clamp(1.0lf - dot(shading_normal, geometric), 0.0lf, 0.5lf);
}

uint directions_of(uint lobe) {
  return lobe - kReflection;
}

bool has_directions(FluxArrival at, uint lobe) {
  return !is_plain_lobe(at, lobe) && bsdf_is_delta(at.bsdf, lobe);
}

dvec3 adjoint_weight(FluxArrival at, uint lobe) {
  if (has_directions(at, lobe)) return work.states.states[photon].directions[directions_of(lobe)].sum;
  dvec3 weight = work.states.states[photon].weights[lobe];
  return is_plain_lobe(at, lobe) ? weight : 0.5lf * (weight + work.states.states[photon].weights[kLobes + lobe]);
}

double gain_of(FluxArrival at) {
  if (at.flat_normals) return 1.0lf;
  dvec3 light = at.surface.to_viewer;
  double falls = dot(light, at.surface.geometric_normal);
  double caught = max(dot(light, at.material.normal), dot(light, at.surface.shading_normal));
  return falls > 0.0lf && caught > falls ? caught / falls : 1.0lf;
}

dvec3 value_of(Bsdf bsdf, uint lobe, dvec3 direction, out double pdf) {
  return is_extended(bsdf) ? extended_lobe(bsdf, lobe, direction, pdf) : plain_lobe(bsdf.plain, lobe, direction, pdf);
}

// The density of a wide lobe's sample, and f times its cosine, as an eye there has it for the light, brought to flux.
bool weigh_wide(FluxArrival at, uint lobe, double plain_chance, inout BsdfSample s) {
  dvec3 light = at.surface.to_viewer;
  double falls = dot(light, at.surface.geometric_normal);
  SurfacePoint seen = seen_from(at, s.direction);
  MaterialPoint material = material_at(at, seen);
  double density = 0.0lf;
  for (uint i = 0u; i < 3u; ++i) {  // by both normals, and as that eye shades
    if (i == 1u && !(plain_chance < 1.0lf)) continue;
    Bsdf bsdf = at.plain;
    if (i == 1u) bsdf = at.bsdf;
    if (i == 2u) bsdf = make_bsdf(material, seen, false);
    double pdf;
    dvec3 value = value_of(bsdf, lobe, i == 2u ? light : s.direction, pdf);
    if (i < 2u) density += (i == 0u ? plain_chance : 1.0lf - plain_chance) * pdf;
    if (i < 2u) continue;
    double leaves = falls > 0.0lf ? abs(dot(s.direction, at.surface.geometric_normal)) / falls : 0.0lf;
    s.weight = value * (abs(dot(light, material.normal)) * leaves);
  }
  if (!(density > 0.0lf)) return false;
  s.pdf = density;
  s.weight /= density;
  return true;
}

bool sample_direction(uint index, inout Sampler random, out BsdfSample s) {
  s = BsdfSample(dvec3(0.0lf), dvec3(0.0lf), 0.0lf);
  uint count = work.states.states[photon].directions[index].count;
  if (count == 0u) return false;
  double sum = sum_of(work.states.states[photon].directions[index].sum);
  double left = count == 1u ? 0.0lf : next_one(random) * sum;
  uint chosen = 0u;
  while (chosen + 1u < count) {
    double weight = sum_of(work.states.states[photon].directions[index].weight[chosen]);
    if (!(left >= weight)) break;
    left -= weight;
    ++chosen;
  }
  dvec3 weight = work.states.states[photon].directions[index].weight[chosen];
  s.direction = work.states.states[photon].directions[index].direction[chosen];
  s.weight = weight * (sum / sum_of(weight));
  return true;
}

bool adjoint_sample(FluxArrival at, uint lobe, inout Sampler random, out BsdfSample s) {
  if (has_directions(at, lobe)) return sample_direction(directions_of(lobe), random, s);
  bool is_wide = !is_plain_lobe(at, lobe);
  double plain_chance = is_wide ? chance_of_plain(at.surface, at.material.normal, lobe) : 0.0lf;
  Bsdf by = at.bsdf;
  if (plain_chance == 1.0lf || (is_wide && next_one(random) < plain_chance)) by = at.plain;
  if (!bsdf_sample(by, lobe, next_two(random, 1u), s)) return false;
  return !is_wide || weigh_wide(at, lobe, plain_chance, s);
}

// Chooses a lobe by what it makes of the photon's flux, then a direction. After the first bounces the photon ends with the chance
// that its light is absorbed.
bool send_on(inout PhotonFlight flight, FluxArrival at, dvec3 weights[kLobes]) {
  uint lobes = is_extended(at.bsdf) ? kLobes : kCoat;
  double chances[kLobes];
  double total = 0.0lf;
  for (uint i = 0u; i < lobes; ++i) {
    chances[i] = sum_of(flight.flux * weights[i]) / sum_of(flight.flux);
    total += chances[i];
  }
  if (!(total > 0.0lf) || !is_finite(total)) return false;
  double whole = flight.bounces < kFirstBounces ? total : max(total, 1.0lf);
  double left = next_one(flight.random) * whole;
  uint chosen = 0u;
  while (chosen < lobes && left >= chances[chosen]) left -= chances[chosen++];
  if (chosen == lobes) return false;
  bool follows = is_followed(at.bsdf, chosen, work.glossy_cutoff);
  if (work.caustics_only != 0u && !follows) return false;
  BsdfSample bounce;
  if (!adjoint_sample(at, chosen, flight.random, bounce)) return false;
  flight.flux *= bounce.weight * (whole / chances[chosen]);
  if (!carries_light(flight.flux)) return false;
  flight.followed = flight.followed && follows;
  flight.media = media_towards(flight.media, at.surface, at.material, bounce.direction);
  flight.direction = bounce.direction;
  flight.position = at.surface.position;
  flight.endless = false;
  flight.origin = ray_origin(at.surface, bounce.direction);
  ++flight.bounces;
  return true;
}

// A surface whose shading normal leans towards the light sends on many times what falls on it, by as many photons.
bool scatter() {
  const double kMaxCopies = 64.0lf;
  FluxArrival at = work.states.states[photon].arrival;
  PhotonFlight flight = work.flights.flights[first_flight()];
  drop_first_flight();
  uint first = work.states.states[photon].first;
  uint waiting = work.states.states[photon].waiting;
  dvec3 weights[kLobes];
  for (uint lobe = 0u; lobe < kLobes; ++lobe) {
    weights[lobe] = lobe < kCoat || is_extended(at.bsdf) ? adjoint_weight(at, lobe) : dvec3(0.0lf);
  }
  uint copies = uint(clamp(gain_of(at), 1.0lf, kMaxCopies));
  bool has_room = true;
  for (uint i = 0u; i < copies; ++i) {
    PhotonFlight other = flight;
    other.flux /= double(copies);
    if (i > 0u) other.random = branch_of(flight.random, i);
    if (!send_on(other, at, weights)) continue;
    has_room = waiting < work.max_flights;
    if (!has_room) break;
    work.flights.flights[photon * work.max_flights + (first + waiting) % work.max_flights] = other;
    ++waiting;
  }
  work.states.states[photon].waiting = waiting;
  return has_room;
}

void main() {
  if (!start_photon()) return;
  if (work.states.states[photon].scatters != 0u) note_cut_off(!scatter());
  work.statuses.statuses[live_index] =
      PhotonStatus(work.states.states[photon].waiting, work.states.states[photon].rays, work.states.states[photon].sent,
                   work.states.states[photon].lost, work.states.states[photon].is_cut_off);
}
