// The first flight of each photon meets a surface.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "photon_kernel.glsl"
#include "trace.glsl"

const double kMaxRayDistance = 1.8e18lf;  // of rays that the CPU traces, in ray space: as in rt/trace/ray_scene.h

bool is_traceable(dvec3 origin, dvec3 direction) {
  dvec3 scaled = abs((origin - work.surfaces.table.space_origin) * work.surfaces.table.space_scale);
  double size = scaled.x + scaled.y + scaled.z;
  double squared_length = dot(direction, direction);
  return size < kMaxRayDistance && squared_length > 0.5lf && squared_length < 2.0lf;
}

void main() {
  if (!start_photon() || !is_under_way()) return;
  PhotonFlight flight = work.flights.flights[first_flight()];
  if (!is_traceable(flight.origin, flight.direction)) {
    note_cut_off(true);
    return;
  }
  work.states.states[photon].rays += 1u;
  work.states.states[photon].met =
      closest_surface(work.scene.tree, TracedRay(flight.origin, flight.direction, kInfinity, true, kNothingPassed));
  note_cut_off(false);
}
