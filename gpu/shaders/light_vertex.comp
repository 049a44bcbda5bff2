// Takes a vertex from each pixel's stack and finds out all that its light depends on.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "reals.glsl"
#include "sampling.glsl"
#include "sampler.glsl"
#include "scene.glsl"
#include "surface_point.glsl"
#include "surfaces.glsl"
#include "view.glsl"
#include "textures.glsl"
#include "materials.glsl"
#include "media.glsl"
#include "microfacets.glsl"
#include "all_bsdfs.glsl"
#include "path.glsl"
#include "light_state.glsl"

void main() {
  if (!start_pixel()) return;
  uint waiting = work.states.states[pixel_index].waiting;
  work.states.states[pixel_index].is_shading = waiting > 0u ? 1u : 0u;
  if (waiting == 0u) return;
  FoundVertex found = work.waiting.found[pixel_index * work.max_waiting + waiting - 1u];
  work.states.states[pixel_index].vertex = make_vertex(work.surfaces.table, work.materials, work.limits, found);
  work.states.states[pixel_index].waiting = waiting - 1u;
  note_cut_off(false);
}
