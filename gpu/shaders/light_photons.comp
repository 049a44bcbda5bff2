// What photons bring to each pixel's vertex.
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
#include "plain_bsdf.glsl"
#include "bsdf.glsl"
#include "path.glsl"
#include "reflection_terms.glsl"
#include "photons.glsl"
#include "gathered_terms.glsl"
#include "light_state.glsl"

void main() {
  if (!start_pixel() || work.states.states[pixel_index].is_shading == 0u) return;
  PathVertex point = work.states.states[pixel_index].vertex;
  ReflectionTerms terms = gathered_terms(point.bsdf, work.limits.glossy_cutoff);
  bool done = true;
  dvec3 light = light_by_photons(PhotonMaps(work.photons), point.surface, terms, point.material.normal, false, kInfinity,
                                 dvec3(0.0lf), 0.0lf, done);
  work.states.states[pixel_index].sum += point.throughput * light;
  note_cut_off(!done);
}
