// All that gives light. Needs what light_kernel.glsl includes.
#include "discrete.glsl"
#include "environment.glsl"
#include "light_tree.glsl"
#include "punctual_lights.glsl"
#include "triangle_lights.glsl"
#include "lights.glsl"
