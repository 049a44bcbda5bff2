// Photons are kept where they arrive: PhotonTracer::arrive.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "photon_kernel.glsl"
#include "punctual_lights.glsl"

// The octahedron unfolded: a direction as x and y in [-1, 1].
dvec2 unfold(dvec3 direction) {
  double size = abs(direction.x) + abs(direction.y) + abs(direction.z);
  if (!(size > 0.0lf) || !is_finite(size)) return dvec2(0.0lf);
  dvec3 d = direction / size;
  if (!(d.z < 0.0lf)) return d.xy;
  double x = 1.0lf - abs(d.y);
  double y = 1.0lf - abs(d.x);
  return dvec2(is_negative(d.x) ? -x : x, is_negative(d.y) ? -y : y);
}

// The low bits of a whole number with a sign.
uint to_bits(double x, uint bits) {
  double steps = double((1u << (bits - 1u)) - 1u);
  double scaled = clamp(x, -1.0lf, 1.0lf) * steps;
  int size = int(floor(abs(scaled) + 0.5lf));
  return uint(is_negative(scaled) ? -size : size) & ((1u << bits) - 1u);
}

bool any_takes_photons(Bsdf bsdf) {
  for (uint lobe = 0u; lobe < kLobes; ++lobe) {
    if (takes_photons(bsdf, lobe, work.glossy_cutoff)) return true;
  }
  return false;
}

void keep(PhotonFlight flight, dvec3 flux, SurfacePoint surface, uint slot) {
  KeptPhoton kept;
  kept.position = vec3((surface.position - work.surfaces.table.space_origin) * work.surfaces.table.space_scale);
  dvec2 facing = unfold(surface.geometric_normal);
  dvec2 direction = unfold(surface.to_viewer);
  kept.facing = to_bits(facing.x, 12u) | (to_bits(facing.y, 12u) << 12) | (surface.layer << 24);
  kept.direction = to_bits(direction.x, 16u) | (to_bits(direction.y, 16u) << 16);
  kept.flux = vec3(flux / work.flux_unit);
  kept.traveled = float(distance(surface.position, flight.position));
  kept.kind = flight.followed ? kKeptCaustic : kKeptGlobal;
  work.kept.kept[slot] = kept;
}

// The BSDF there, and that by the true surface's normal; false where no light is scattered.
bool make_bsdfs(SurfacePoint surface, MaterialPoint material, PhotonFlight flight, uint slot) {
  bool flat_normals = surface.shading_normal == surface.geometric_normal && surface.tangent == dvec3(0.0lf);
  work.states.states[photon].arrival.flat_normals = flat_normals;
  bool has_light = carries_light(flight.flux);
  for (uint i = 0u; i < (flat_normals ? 1u : 2u); ++i) {
    if (i == 1u) {
      material.normal = surface.geometric_normal;
#ifndef PLAIN_MATERIALS
      material.extensions.clearcoat_normal = surface.geometric_normal;
#endif
    }
    Bsdf bsdf = make_bsdf(material, surface, true);
    for (uint lobe = 0u; lobe < (is_extended(bsdf) ? kLobes : kCoat); ++lobe) {
      work.states.states[photon].weights[i * kLobes + lobe] = bsdf_weight(bsdf, lobe);
    }
    if (i == 1u) {
      work.states.states[photon].arrival.plain = bsdf;
      continue;
    }
    work.states.states[photon].arrival.bsdf = bsdf;
    if (flight.bounces > 0u && has_light && any_takes_photons(bsdf)) keep(flight, flight.flux, surface, slot);
    if (!has_light) return false;
  }
  return true;
}

void arrive(uint slot) {
  PhotonFlight flight = work.flights.flights[first_flight()];
  uint met = work.states.states[photon].met;
  if (met == kNoSurface) {
    drop_first_flight();
    return;
  }
  SurfacePoint surface = meet_surface(work.surfaces.table, met, flight.position, flight.direction);
  MaterialPoint material = evaluate_material(work.materials, surface);
  // As to lights: no light is absorbed on endless flights.
  if (!flight.endless) {
    flight.flux *= transmittance_to(flight.media, surface, material, distance(surface.position, flight.position));
  }
  if (flight.bounces == 0u) flight.flux *= range_window(distance(surface.position, flight.center), flight.range);
  if (disperses(material)) choose_channel(material, flight.flux, next_one(flight.random));
  work.states.states[photon].arrival.surface = surface;
  work.states.states[photon].arrival.material = material;
  bool goes_on = make_bsdfs(surface, material, flight, slot);
  if (goes_on && flight.bounces >= work.max_bounces) {
    work.states.states[photon].lost += 1u;
    goes_on = false;
  }
  if (goes_on) {
    work.flights.flights[first_flight()] = flight;
    work.states.states[photon].scatters = 1u;
  } else {
    drop_first_flight();
  }
}

void main() {
  if (!start_photon()) return;
  uint slot = round * live_count + live_index;
  work.kept.kept[slot].kind = kNotKept;
  work.states.states[photon].scatters = 0u;
  if (!is_under_way()) return;
  arrive(slot);
  note_cut_off(false);
}
