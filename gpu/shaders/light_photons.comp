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
  FoundVertex found = found_vertex();
  PhotonMaps photons = PhotonMaps(work.photons);
  PhotonUse use = photons_of_path(photons, work.limits.gathers != 0u, point.gather_reach,
                                  distance(point.surface.position, found.previous_position), found.previous_pdf);
  dvec3 light = gathered_light(photons, use, point.surface, point.bsdf, point.material.normal, work.limits.glossy_cutoff, done);
  add_diffuse_light(point, point.throughput * light);
  note_cut_off(!done);
}
