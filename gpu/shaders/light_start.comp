// The first vertex of each pixel's path: the surface that its key names. Where there is none, what lies past all surfaces.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "light_kernel.glsl"
#include "all_lights.glsl"

// Has the pixel's first vertex wait: that on `surface`, which a ray meets.
void start_path(uint view, Ray ray, double coverage, Sampler random, uint surface) {
  FoundVertex first;
  first.origin = ray.origin;
  first.direction = ray.direction;
  first.throughput = dvec3(coverage);
  first.media = work.eye_media.media[view];
  first.previous_position = work.views.views[view].eye;
  first.previous_normal = dvec3(0.0lf);
  first.previous_pdf = 0.0lf;
  first.random = random;
  first.surface = surface;
  first.depth = 0u;
  work.waiting.found[pixel_index * work.max_waiting] = first;
  work.states.states[pixel_index].waiting = 1u;
  work.states.states[pixel_index].covered = 1u;
}

// A surface of which the CPU knows that a pixel shows it.
void start_point(uint view) {
  EyePoint point = work.points.points[pixel_index];
  if (point.surface == kNoSurface) return;
  start_path(view, Ray(point.origin, point.direction), point.coverage, point.random, point.surface);
}

void main() {
  if (!start_pixel()) return;
  ShadedTile tile = tile_of_pixel();
  uvec2 place = pixel_in_tile();
  work.states.states[pixel_index].sum = dvec3(0.0lf);
  work.states.states[pixel_index].diffuse = dvec3(0.0lf);
  work.states.states[pixel_index].direct = dvec3(0.0lf);
  work.states.states[pixel_index].nearest = uintBitsToFloat(0x7F800000u);
  work.states.states[pixel_index].waiting = 0u;
  work.states.states[pixel_index].is_cut_off = 0u;
  work.states.states[pixel_index].covered = 0u;
  if (uint64_t(work.points) != 0ul) {
    start_point(tile.view);
    return;
  }
  if (place.x >= tile.size.x || place.y >= tile.size.y) return;
  View view = work.views.views[tile.view];
  uvec2 at = uvec2(tile.corner) + place;
  Ray ray = view_ray(view, at);
  uint64_t key = work.keys.keys[pixel_index];
  if (key == 0ul) {
    Lights lights = Lights(work.lights);
    work.states.states[pixel_index].sum =
        work.shows_environment != 0u ? environment_radiance(lights, normalize(ray.direction)) : work.background;
    return;
  }
  Sampler random = make_sampler(pixel_stream(work.random_frame, view.screen_number, view.block + ivec2(at)), work.sample_index);
  start_path(tile.view, ray, 1.0lf, random, ~uint(key));
}
