// The light of each pixel, once all is added up.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "light_kernel.glsl"

void main() {
  if (!start_pixel()) return;
  PixelState state = work.states.states[pixel_index];
  work.pixels.pixels[pixel_index] = vec4(state.sum, state.is_cut_off != 0u ? kUnfinished : float(state.covered));
}
