// The ambient-occlusion pass: even light from all sides that surfaces near by keep out.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "light_kernel.glsl"
#include "trace.glsl"
#include "light_rays.glsl"

uint occlusion_rays = 0u;

const uint kOcclusionBranch = 16u;  // AmbientOcclusionPass::kBranch

dvec3 ambient_light(PathVertex point) {
  dvec3 sum = dvec3(0.0lf);
  uint count = work.occlusion_rays;
  if (count == 0u || bsdf_weight(point.bsdf, kDiffuse) == dvec3(0.0lf)) return sum;
  Sampler random = branch_of(point.random, kOcclusionBranch);
  for (uint i = 0u; i < count; ++i) {
    BsdfSample bounce;
    if (!bsdf_sample(point.bsdf, kDiffuse, next_two(random, 1u), bounce)) continue;
    TracedRay ray = TracedRay(ray_origin(point.surface, bounce.direction) + point.surface.lift, bounce.direction,
                              work.occlusion_reach, true, kNothingPassed);
    ++occlusion_rays;
    double passed = passed_light(ray);
    if (passed == 0.0lf) continue;
    sum += passed * point.throughput * bounce.weight * (point.material.occlusion * work.ambient / double(count));
  }
  return sum;
}

void shade() {
  if (!start_pixel() || work.states.states[pixel_index].is_shading == 0u) return;
  PathVertex point = work.states.states[pixel_index].vertex;
  add_diffuse_light(point, ambient_light(point));
  note_cut_off(coverage_notes.is_unfinished);
}

void main() {
  start_counts();
  shade();
  atomicAdd(group_counts[kOcclusionRays], occlusion_rays);
  count_cut_rays();
  add_counts();
}
