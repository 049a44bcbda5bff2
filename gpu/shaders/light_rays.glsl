// What rays of light meet, where surfaces cover wholly and in part.
// Needs light_kernel.glsl and trace.glsl.
#include "coverage.glsl"

CoverageNotes coverage_notes = CoverageNotes(0u, false);

void count_cut_rays() {
  if (kHasCoverage) atomicAdd(group_counts[kCutRays], coverage_notes.cut);
}

// The fraction of light that gets through to the end of the ray.
double passed_light(TracedRay ray) {
  if (!kHasCoverage) return is_blocked(work.scene.tree, ray) ? 0.0lf : 1.0lf;
  return passed_fraction(work.scene, work.alpha_tested, work.surfaces, work.materials, ray, coverage_notes);
}

// The surface that a ray along a lobe meets.
uint followed_surface(TracedRay ray, inout Sampler random) {
  if (!kHasCoverage) return closest_surface(work.scene.tree, ray);
  return closest_by_chance(work.scene, work.alpha_tested, work.surfaces, work.materials, ray, random, coverage_notes);
}
