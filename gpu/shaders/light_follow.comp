// Follows the lobes of each pixel's vertex by rays: the surfaces that they meet wait.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "light_kernel.glsl"
#include "all_lights.glsl"
#include "trace.glsl"
#include "light_rays.glsl"

uint reflection_rays = 0u;
uint refraction_rays = 0u;

// Follows a lobe by a ray: returns the sky's light that it finds; the surface that it meets waits.
dvec3 follow(PathVertex point, Bsdf bsdf, uint lobe) {
  Sampler random = branch_of(point.random, lobe);
  BsdfSample bounce;
  if (!bsdf_sample(bsdf, lobe, next_two(random, point.depth), bounce)) return dvec3(0.0lf);
  dvec3 throughput = point.lobe_weights[lobe] * point.throughput * bounce.weight;
  throughput *= roulette_weight(largest(throughput), random);
  if (throughput == dvec3(0.0lf)) return dvec3(0.0lf);
  if (lobe == kTransmission || lobe == kDiffuseTransmission) {
    ++refraction_rays;
  } else {
    ++reflection_rays;
  }
  FoundVertex next;
  next.origin = ray_origin(point.surface, bounce.direction);
  next.direction = bounce.direction;
  bool meets_backs = leads_into_solid(point.surface, point.material, bounce.direction);
  next.surface = followed_surface(TracedRay(next.origin, next.direction, kInfinity, meets_backs, kNothingPassed), random);
  if (next.surface == kNoSurface) {
    Lights lights = Lights(work.lights);
    double light_pdf = bounce.pdf > 0.0lf ? environment_pdf(lights, point.surface.position,
                                                         bsdf_light_normal(point.bsdf), bounce.direction)
                                       : 0.0lf;
    return balance(bounce.pdf, light_pdf) * throughput * environment_radiance(lights, bounce.direction);
  }
  next.throughput = throughput;
  next.media = media_towards(point.media, point.surface, point.material, bounce.direction);
  next.previous_position = point.surface.position;
  next.previous_normal = bsdf_light_normal(point.bsdf);
  next.previous_pdf = bounce.pdf;
  next.random = random;
  next.depth = point.depth + 1u;
  add_waiting(next);
  return dvec3(0.0lf);
}

dvec3 followed_light(PathVertex point) {
  dvec3 sum = dvec3(0.0lf);
  for (uint lobe = 0u; lobe < kLobes; ++lobe) {
    if (point.lobe_weights[lobe] == 0.0lf) continue;
    bool splits = lobe == kTransmission && splits_channels(point);
    for (uint channel = 0u; channel < (splits ? 3u : 1u); ++channel) {
      Bsdf bsdf = point.bsdf;
      if (splits) {
        if (!(point.throughput[channel] > 0.0lf)) continue;
        MaterialPoint only = point.material;
        set_channel(only, channel, 1.0lf);
        bsdf = make_bsdf(only, point.surface, false);
      }
      sum += follow(point, bsdf, lobe);
    }
  }
  return sum;
}

void shade() {
  if (!start_pixel() || work.states.states[pixel_index].is_shading == 0u) return;
  waiting_count = work.states.states[pixel_index].waiting;
  work.states.states[pixel_index].sum += followed_light(work.states.states[pixel_index].vertex);
  work.states.states[pixel_index].waiting = waiting_count;
  note_cut_off(is_crowded || coverage_notes.is_unfinished);
}

void main() {
  start_counts();
  shade();
  atomicAdd(group_counts[kReflectionRays], reflection_rays);
  atomicAdd(group_counts[kRefractionRays], refraction_rays);
  count_cut_rays();
  if (waiting_count > 0u) atomicAdd(group_counts[kWaitingPixels], 1u);
  add_counts();
}
