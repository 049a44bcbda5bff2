// What each pixel's vertex emits, and what lights give to it directly.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "light_kernel.glsl"
#include "all_lights.glsl"
#include "trace.glsl"
#include "light_rays.glsl"

uint shadow_rays = 0u;

dvec3 emitted_light(PathVertex point, FoundVertex found) {
  Lights lights = Lights(work.lights);
  if (point.material.emission == dvec3(0.0lf) || (point.reached_by & kCaustic) != 0u) return dvec3(0.0lf);
  if (point.material.unlit && (point.reached_by & kGathered) != 0u) return dvec3(0.0lf);
  double weight = 1.0lf;
  if (found.previous_pdf > 0.0lf) {
    weight = balance(found.previous_pdf, surface_pdf(lights, found.previous_position, found.previous_normal,
                                                     point.surface.surface, point.surface.position));
  }
  return weight * point.throughput * point.material.emission;
}

TracedRay shadow_ray(PathVertex point, LightSample light) {
  TracedRay ray;
  ray.origin = ray_origin(point.surface, light.to_light);
  bool viewers_side = dot(light.to_light, point.surface.geometric_normal) > 0.0lf;
  if (work.terminator_fix != 0u && viewers_side) ray.origin += point.surface.lift;
  ray.direction = light.to_light;
  ray.reach = light.distance;
  ray.meets_backs = true;
  ray.passed = kNothingPassed;
  if (isinf(light.distance)) return ray;
  dvec3 to_goal = light.goal - ray.origin;
  double distance = length(to_goal);
  double before = kOriginSteps * kFloatStep * distance +
                  max(light.offset, rounding_at(work.surfaces.table, light.goal));
  ray.reach = max(distance - before, 0.0lf);
  if (distance > 0.0lf) ray.direction = to_goal / distance;
  return ray;
}

// Light of a sample that reaches the pixel, if nothing is between.
dvec3 sampled_light(PathVertex point, LightSample light) {
  if (light.weight == dvec3(0.0lf)) return dvec3(0.0lf);
  // The headlight stands at the eye and lights what the eye sees only.
  if (!light.casts_shadows && (point.reached_by & kGathered) != 0u) return dvec3(0.0lf);
  dvec3 scattered = dvec3(0.0lf);
  bool leaves = leaves_caustics(work.limits, point);
  if (light.pdf > 0.0lf || leaves) {
    Scattering all = bsdf_scattering(point.bsdf, light.to_light);
    bool may_be_found = light.pdf > 0.0lf && (!gathers_near(point) || light.distance < point.gather_reach);
    for (uint lobe = 0u; lobe < kLobes; ++lobe) {
      if (leaves && follows_lobe(work.limits, point.bsdf, lobe)) continue;
      bool is_balanced = may_be_found && point.may_follow[lobe];
      double weight = is_balanced ? 1.0lf - balance(all.pdf[lobe], light.pdf) : 1.0lf;
      scattered += weight * all.value[lobe];
    }
  } else {
    scattered = bsdf_total(point.bsdf, light.to_light);
  }
  double cosine = abs(dot(point.material.normal, light.to_light));
  dvec3 radiance = point.throughput * scattered * light.weight * cosine;
  if (light.casts_shadows) {
    radiance *= transmittance_to_light(point.media, point.surface, point.material, light.to_light, light.distance);
  }
  return radiance;
}

dvec3 visible_light(PathVertex point, LightSample light) {
  dvec3 radiance = sampled_light(point, light);
  if (radiance == dvec3(0.0lf)) return radiance;
  if (!light.casts_shadows || work.shadows == 0u) return radiance;
  ++shadow_rays;
  return passed_light(shadow_ray(point, light)) * radiance;
}

// Light of number `i`: of those that are sampled one by one, then of the others. False where there is none.
bool sample_light(Lights lights, View view, uint i, inout PathVertex point, out LightSample light) {
  uint count = enumerated_lights(lights);
  if (i < count) {
    dvec2 u = enumerated_is_fixed(lights, i) ? dvec2(0.0lf) : next_two(point.random, point.depth);
    light = sample_enumerated(lights, i, point.surface.position, view, u);
    return true;
  }
  double choice = next_one(point.random);
  dvec2 u = next_two(point.random, i == count ? point.depth : 1u);
  if (!sample_lights(lights, point.surface.position, bsdf_light_normal(point.bsdf), view, choice, u, light)) return false;
  light.weight /= double(work.light_samples);
  return true;
}

dvec3 direct_light(View view, inout PathVertex point) {
  Lights lights = Lights(work.lights);
  dvec3 sum = dvec3(0.0lf);
  uint count = enumerated_lights(lights) + (has_tree(lights) ? work.light_samples : 0u);
  for (uint i = 0u; i < count; ++i) {
    LightSample light;
    if (sample_light(lights, view, i, point, light)) sum += visible_light(point, light);
  }
  return sum;
}

void shade() {
  if (!start_pixel() || work.states.states[pixel_index].is_shading == 0u) return;
  PathVertex point = work.states.states[pixel_index].vertex;
  dvec3 sum = emitted_light(point, found_vertex());
  sum += direct_light(work.views.views[tile_of_pixel().view], point);
  work.states.states[pixel_index].sum += sum;
  if (point.depth == 0u) work.states.states[pixel_index].direct += sum;
  if (is_diffuse_path(point)) work.states.states[pixel_index].diffuse += sum;
  note_cut_off(coverage_notes.is_unfinished);
}

void main() {
  start_counts();
  shade();
  atomicAdd(group_counts[kShadowRays], shadow_rays);
  count_cut_rays();
  add_counts();
}
