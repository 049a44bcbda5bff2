// The light of each pixel, once all is added up.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "light_kernel.glsl"

void main() {
  if (!start_pixel()) return;
  PixelState state = work.states.states[pixel_index];
  if (uint64_t(work.point_lights) != 0ul) {
    work.point_lights.lights[pixel_index] =
        PointLight(state.sum, state.diffuse, state.direct, state.nearest, state.is_cut_off);
    return;
  }
  work.pixels.pixels[pixel_index] = vec4(state.sum, state.is_cut_off != 0u ? kUnfinished : state.covered);
}
