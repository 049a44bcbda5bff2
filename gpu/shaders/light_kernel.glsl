// What all kernels that light tiles include.

// Whether the scene has surfaces that cover in part.
layout(constant_id = 0) const bool kHasCoverage = false;

#include "reals.glsl"
#include "sampling.glsl"
#include "sampler.glsl"
#include "scene.glsl"
#include "surface_point.glsl"
#include "surfaces.glsl"
#include "view.glsl"
#include "textures.glsl"
#include "materials.glsl"
#include "media.glsl"
#include "microfacets.glsl"
#include "all_bsdfs.glsl"
#include "path.glsl"
#include "light_state.glsl"
