// What photons bring to each pixel's vertex.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "light_kernel.glsl"
#include "reflection_terms.glsl"
#include "photons.glsl"
#include "gathered_terms.glsl"

void main() {
  if (!start_pixel() || work.states.states[pixel_index].is_shading == 0u) return;
  PathVertex point = work.states.states[pixel_index].vertex;
  bool done = true;
  dvec3 light = gathered_light(PhotonMaps(work.photons), point.surface, point.bsdf, point.material.normal,
                               work.limits.glossy_cutoff, done);
  add_diffuse_light(point.depth, point.throughput * light);
  note_cut_off(!done);
}
