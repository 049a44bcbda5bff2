// How surfaces scatter light, with extensions or, where a scene has none (PLAIN_MATERIALS), without.
#include "plain_bsdf.glsl"
#ifdef PLAIN_MATERIALS
#include "no_extensions.glsl"
#else
#include "sheen.glsl"
#include "thin_film.glsl"
#include "anisotropic_facets.glsl"
#include "extended_bsdf.glsl"
#endif
#include "bsdf.glsl"
