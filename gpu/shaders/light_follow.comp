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
uint gather_rays = 0u;
dvec3 sky_light = dvec3(0.0lf);
dvec3 first_sky = dvec3(0.0lf);  // of that what rays that gather bring to the first surface

// The sky's light that a ray which leaves the scene brings to the pixel, as far as sampling lights does not find it.
dvec3 sky_along(PathVertex point, bool gathers, dvec3 throughput, dvec3 direction, double pdf) {
  Lights lights = Lights(work.lights);
  bool gathered = gathers || (point.reached_by & kGathered) != 0u;
  if (gathers && gathers_near(point)) return dvec3(0.0lf);
  if (lights.has_environment == 0u && gathered) return dvec3(0.0lf);  // a backdrop is no light
  if (!gathers && leaves_caustics(work.limits, point)) return dvec3(0.0lf);
  double light_pdf =
      pdf > 0.0lf ? environment_pdf(lights, point.surface.position, bsdf_light_normal(point.bsdf), direction) : 0.0lf;
  return balance(pdf, light_pdf) * throughput * environment_radiance(lights, direction);
}

void add_sky(PathVertex point, bool gathers, dvec3 sky) {
  sky_light += sky;
  if (point.depth == 0u && gathers) first_sky += sky;
}

// By what the path comes to the vertex that a ray reaches.
uint reached_from(PathVertex point, bool gathers) {
  uint bits = point.reached_by & (kGathered | kDiffusePath);
  if (gathers) bits |= kGathered;
  if (gathers && point.depth == 0u) bits |= kDiffusePath;
  if (!gathers && leaves_caustics(work.limits, point)) bits |= kCaustic;
  return bits;
}

void count_ray(uint lobe, bool gathers) {
  if (gathers) {
    ++gather_rays;
  } else if (lobe == kTransmission || lobe == kDiffuseTransmission) {
    ++refraction_rays;
  } else {
    ++reflection_rays;
  }
}

// Follows a lobe by a ray: adds the sky's light that it finds; the surface that it meets waits.
void follow(PathVertex point, Bsdf bsdf, uint lobe) {
  Sampler random = branch_of(point.random, lobe);
  BsdfSample bounce;
  if (!bsdf_sample(bsdf, lobe, next_two(random, point.depth), bounce)) return;
  dvec3 throughput = point.lobe_weights[lobe] * point.throughput * bounce.weight;
  throughput *= roulette_weight(largest(throughput), random);
  if (throughput == dvec3(0.0lf)) return;
  bool gathers = gathers_lobe(work.limits, point.bsdf, lobe);
  count_ray(lobe, gathers);
  FoundVertex next;
  next.origin = ray_origin(point.surface, bounce.direction);
  next.direction = bounce.direction;
  // Rays that carry the eye's look on see what it sees; those that gather light meet what light meets.
  bool looks = !gathers && (point.reached_by & kGathered) == 0u;
  bool meets_backs = !looks || leads_into_solid(point.surface, point.material, bounce.direction);
  double reach = gathers ? point.gather_reach : kInfinity;
  next.surface = followed_surface(TracedRay(next.origin, next.direction, reach, meets_backs, kNothingPassed), random);
  if (next.surface == kNoSurface) {
    add_sky(point, gathers, sky_along(point, gathers, throughput, bounce.direction, bounce.pdf));
    return;
  }
  next.throughput = throughput;
  next.media = media_towards(point.media, point.surface, point.material, bounce.direction);
  next.previous_position = point.surface.position;
  next.previous_normal = bsdf_light_normal(point.bsdf);
  next.previous_pdf = bounce.pdf;
  next.random = random;
  next.depth = point.depth + 1u;
  next.followed = point.followed + (gathers ? 0u : 1u);
  next.reached_by = reached_from(point, gathers);
  add_waiting(next);
}

void follow_lobes(PathVertex point) {
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
      follow(point, bsdf, lobe);
    }
  }
}

void shade() {
  if (!start_pixel() || work.states.states[pixel_index].is_shading == 0u) return;
  waiting_count = work.states.states[pixel_index].waiting;
  PathVertex point = work.states.states[pixel_index].vertex;
  follow_lobes(point);
  work.states.states[pixel_index].sum += sky_light;
  work.states.states[pixel_index].direct += first_sky;
  work.states.states[pixel_index].diffuse += is_diffuse_path(point) ? sky_light : first_sky;
  work.states.states[pixel_index].waiting = waiting_count;
  note_cut_off(is_crowded || coverage_notes.is_unfinished);
}

void main() {
  start_counts();
  shade();
  atomicAdd(group_counts[kReflectionRays], reflection_rays);
  atomicAdd(group_counts[kRefractionRays], refraction_rays);
  atomicAdd(group_counts[kGatherRays], gather_rays);
  count_cut_rays();
  if (waiting_count > 0u) atomicAdd(group_counts[kWaitingPixels], 1u);
  add_counts();
}
