// Takes a vertex from each pixel's stack and finds out all that its light depends on.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "light_kernel.glsl"

void main() {
  if (!start_pixel()) return;
  uint waiting = work.states.states[pixel_index].waiting;
  work.states.states[pixel_index].is_shading = waiting > 0u ? 1u : 0u;
  if (waiting == 0u) return;
  FoundVertex found = work.waiting.found[pixel_index * work.max_waiting + waiting - 1u];
  PathVertex point = make_vertex(work.surfaces.table, work.materials, work.limits, found);
  work.states.states[pixel_index].vertex = point;
  if (found.depth == 1u && (found.reached_by & kGathered) == 0u) {
    float metres = float(distance(point.surface.position, found.previous_position));
    work.states.states[pixel_index].nearest = min(work.states.states[pixel_index].nearest, metres);
  }
  work.states.states[pixel_index].waiting = waiting - 1u;
  note_cut_off(false);
}
