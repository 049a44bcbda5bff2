// Photons leave their lights: PhotonTracer::start.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "photon_kernel.glsl"
#include "all_lights.glsl"
#include "photon_emission.glsl"

void main() {
  if (!start_photon()) return;
  work.states.states[photon].first = 0u;
  work.states.states[photon].waiting = 0u;
  work.states.states[photon].scatters = 0u;
  work.states.states[photon].rays = 0u;
  work.states.states[photon].sent = 0u;
  work.states.states[photon].lost = 0u;
  work.states.states[photon].is_cut_off = 0u;
  uint64_t index = work.first + uint64_t(photon);
  // The sampler counts to 2^32; a stream of its own follows.
  Sampler random = make_sampler(work.stream + (index >> 32), uint(index));
  double choice = next_one(random);
  dvec2 u_place = next_two(random, 1u);
  dvec2 u_direction = next_two(random, 1u);
  PhotonStart start;
  if (!emit_photon(Lights(work.lights), choice, u_place, u_direction, start)) {
    note_cut_off(false);
    return;
  }
  work.states.states[photon].sent = 1u;
  PhotonFlight flight;
  flight.random = random;
  flight.position = start.origin;
  flight.origin = start.origin;
  flight.direction = start.direction;
  flight.flux = start.flux * work.fraction;
  flight.media = start.media;
  flight.center = start.center;
  flight.range = start.range;
  flight.bounces = 0u;
  flight.followed = true;
  flight.endless = start.endless;
  if (start.surface != kNoSurface) {
    WorldTriangle triangle = load_triangle(work.surfaces.table, start.surface);
    double side = dot(triangle.normal, start.direction) < 0.0lf ? -1.0lf : 1.0lf;
    flight.origin += side * max(start.offset, rounding_at(work.surfaces.table, start.origin)) * triangle.normal;
  }
  if (carries_light(flight.flux)) {
    work.flights.flights[first_flight()] = flight;
    work.states.states[photon].waiting = 1u;
  }
  note_cut_off(false);
}
