// The first vertices of each pixel's path: the surface that its key names, and those before it that cover in part. Where there is
// no key, what lies past all surfaces.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "light_kernel.glsl"
#include "all_lights.glsl"
#include "trace.glsl"
#include "light_rays.glsl"

// A vertex that a ray from the eye meets.
FoundVertex first_vertex(uint view, Ray ray, Sampler random) {
  FoundVertex first;
  first.origin = ray.origin;
  first.direction = ray.direction;
  first.throughput = dvec3(1.0lf);
  first.media = work.eye_media.media[view];
  first.previous_position = work.views.views[view].eye;
  first.previous_normal = dvec3(0.0lf);
  first.previous_pdf = 0.0lf;
  first.random = random;
  first.surface = kNoSurface;
  first.depth = 0u;
  first.followed = 0u;
  first.reached_by = 0u;
  return first;
}

// eye_ray() of rt/passes/path_vertex.cpp.
TracedRay eye_ray(View view, FoundVertex first) {
  TracedRay ray;
  ray.origin = first.origin + first.direction * view.near_distance;
  ray.direction = normalize(first.direction);
  ray.reach = view.orthographic != 0u ? view.far_distance - view.near_distance : kInfinity;
  ray.meets_backs = false;
  ray.passed = kNothingPassed;
  return ray;
}

// The surfaces before that of the key wait, each with the fraction of the pixel that it covers. Returns the fraction left.
double find_layers(View view, FoundVertex first) {
  TracedRay ray = eye_ray(view, first);
  LayerSearch search = start_search(work.alpha_tested, work.surfaces, work.materials, ray, first.surface);
  double left = 1.0lf;
  CoveringLayer layer;
  while (left > 0.0lf && next_layer(search, layer)) {
    Sampler random = branch_of(first.random, layer.surface);
    double covered = left * layer.coverage;
    double fraction = covered * roulette_weight(covered, random);
    if (fraction > 0.0lf) {
      FoundVertex found = first;
      found.origin = ray.origin;
      found.direction = ray.direction;
      found.throughput = dvec3(fraction);
      found.surface = layer.surface;
      add_waiting(found);
    }
    left *= 1.0lf - layer.coverage;
    left *= roulette_weight(left, random);
  }
  note_end(search, left > 0.0lf, coverage_notes);
  return left;
}

// A surface of which the CPU knows that a pixel shows it.
void start_point(uint view) {
  EyePoint point = work.points.points[pixel_index];
  if (point.surface == kNoSurface) return;
  FoundVertex first = first_vertex(view, Ray(point.origin, point.direction), point.random);
  first.throughput = dvec3(point.coverage);
  first.surface = point.surface;
  add_waiting(first);
}

// All that the pixel shows along the ray through its centre.
void start_all(uint view_number, uvec2 at) {
  uint64_t key = work.keys.keys[pixel_index];
  View view = work.views.views[view_number];
  Sampler random = make_sampler(pixel_stream(work.random_frame, view.screen_number, view.block + ivec2(at)), work.sample_index);
  FoundVertex first = first_vertex(view_number, view_ray(view, at), random);
  first.surface = key == 0ul ? kNoSurface : ~uint(key);
  double left = kHasCoverage ? find_layers(view, first) : 1.0lf;
  double uncovered = key == 0ul ? left : 0.0lf;
  if (key != 0ul && left > 0.0lf) {
    first.throughput = dvec3(left);
    add_waiting(first);
  }
  if (uncovered > 0.0lf) {
    Lights lights = Lights(work.lights);
    work.states.states[pixel_index].sum =
        uncovered * (work.shows_environment != 0u ? environment_radiance(lights, normalize(first.direction)) : work.background);
  }
  work.states.states[pixel_index].covered = float(1.0lf - uncovered);
}

void start() {
  if (!start_pixel()) return;
  ShadedTile tile = tile_of_pixel();
  uvec2 place = pixel_in_tile();
  work.states.states[pixel_index].sum = dvec3(0.0lf);
  work.states.states[pixel_index].diffuse = dvec3(0.0lf);
  work.states.states[pixel_index].direct = dvec3(0.0lf);
  work.states.states[pixel_index].nearest = uintBitsToFloat(0x7F800000u);
  work.states.states[pixel_index].waiting = 0u;
  work.states.states[pixel_index].is_cut_off = 0u;
  work.states.states[pixel_index].covered = 0.0;
  if (uint64_t(work.points) != 0ul) {
    start_point(tile.view);
  } else if (place.x < tile.size.x && place.y < tile.size.y && work.keys.keys[pixel_index] != kUnwanted) {
    start_all(tile.view, uvec2(tile.corner) + place);
  }
  work.states.states[pixel_index].waiting = waiting_count;
  if (kHasCoverage) note_cut_off(is_crowded || coverage_notes.is_unfinished);
}

void main() {
  start_counts();
  start();
  count_cut_rays();
  add_counts();
}
