// What the kernels that light tiles have in common: their input, and what they keep of every pixel between them. A pixel's path
// is a tree: one vertex after the other is shaded, those that its rays reached wait on a stack of the pixel's own. So every
// pixel's light is added up in one order, whatever is lit beside it.
// Needs all that makes points of surfaces, materials, BSDFs and views, and path.glsl.

struct ShadedTile {
  ivec2 corner;  // on the view's block
  uvec2 size;
  uint view;
  uint padding;
};
layout(buffer_reference, scalar) readonly buffer ShadedTiles {
  ShadedTile tiles[];
};
layout(buffer_reference, scalar) readonly buffer Keys {
  uint64_t keys[];
};
layout(buffer_reference, scalar) writeonly buffer ShadedPixels {
  vec4 pixels[];  // radiance, and the share that surfaces cover
};
// A surface that a pixel shows: EyePoint in rt/tile_shader.h.
struct EyePoint {
  dvec3 origin;
  dvec3 direction;
  double coverage;
  Sampler random;
  uint surface;
  uint pixel;
};
layout(buffer_reference, scalar) readonly buffer EyePoints {
  EyePoint points[];
};
// What reaches the pixel from there.
struct PointLight {
  dvec3 radiance;
  dvec3 diffuse;
  dvec3 direct;
  float nearest;
  uint is_unfinished;
};
layout(buffer_reference, scalar) writeonly buffer PointLights {
  PointLight lights[];
};
layout(buffer_reference, scalar) readonly buffer ViewList {
  View views[];
};
layout(buffer_reference, scalar) readonly buffer MediaList {
  Media media[];
};
layout(buffer_reference, scalar) buffer Counters {
  uint counts[];
};

// Of a pixel.
struct PixelState {
  dvec3 sum;
  dvec3 diffuse;  // as PointLight has them
  dvec3 direct;
  float nearest;
  uint waiting;     // vertices on its stack
  uint is_shading;  // whether `vertex` is one that it had
  uint is_cut_off;  // a device ended a loop, or more waited than there is room for
  float covered;
  PathVertex vertex;
};
layout(buffer_reference, scalar) buffer PixelStates {
  PixelState states[];
};
layout(buffer_reference, scalar) buffer WaitingVertices {
  FoundVertex found[];
};

struct LightInput {
  SceneTrees scene;         // surfaces that cover all behind them
  SceneTrees alpha_tested;  // the others
  SurfaceTables surfaces;
  Materials materials;
  uint64_t lights;
  uint64_t photons;  // null: none
  ShadedTiles tiles;
  Keys keys;
  ShadedPixels pixels;
  PixelStates states;
  WaitingVertices waiting;
  ViewList views;
  MediaList eye_media;  // of each view
  Counters counters;
  EyePoints points;  // in place of keys, so many as tiles have pixels; null: keys
  PointLights point_lights;
  uint64_t random_frame;
  dvec3 background;
  double ambient;
  double occlusion_reach;
  PathLimits limits;
  uint shows_environment;  // past all surfaces, in place of `background`
  uint sample_index;
  uint light_samples;
  uint occlusion_rays;
  uint shadows;
  uint terminator_fix;
  uint max_waiting;  // vertices of a pixel
  uint padding;
};
layout(buffer_reference, scalar) readonly buffer LightInputs {
  LightInput light;
};
layout(push_constant, scalar) uniform Constants {
  LightInputs inputs;
  uint tile_count;
  uint padding;
};

const uint kTilePixels = 4096u;
const uint kTileSide = 64u;
const float kUnfinished = -1.0;  // no pixel covers so little
const uint64_t kUnwanted = 0x100000000ul;  // the key of a pixel that is left out

// As they are counted.
const uint kShadowRays = 0u;
const uint kReflectionRays = 1u;
const uint kRefractionRays = 2u;
const uint kOcclusionRays = 3u;
const uint kGatherRays = 4u;
const uint kWaitingPixels = 5u;  // that are not done
const uint kCutRays = 6u;        // that ended among too many surfaces
const uint kCounters = 7u;

LightInput work;
uint pixel_index;  // among all that are lit together

// Whether this thread has a pixel; sets what is known of it.
bool start_pixel() {
  pixel_index = uint(thread_index());
  if (pixel_index >= tile_count * kTilePixels) return false;
  work = inputs.light;
  return true;
}

// The fraction of light found along a ray of density `pdf` that is left to it where sampling lights finds it too.
double balance(double pdf, double light_pdf) {
  if (!(pdf > 0.0lf)) return 1.0lf;
  return pdf / (pdf + light_pdf * double(work.light_samples));
}

ShadedTile tile_of_pixel() {
  return work.tiles.tiles[pixel_index / kTilePixels];
}

uvec2 pixel_in_tile() {
  return uvec2(pixel_index % kTileSide, pixel_index / kTileSide % kTileSide);
}

// The vertex that is shaded, as it was found: where it waited, until others do.
FoundVertex found_vertex() {
  return work.waiting.found[pixel_index * work.max_waiting + work.states.states[pixel_index].waiting];
}

bool is_diffuse_path(PathVertex point) {
  return (point.reached_by & kDiffusePath) != 0u;
}

// Adds light that a vertex scatters by lobes which no pass follows for itself.
void add_diffuse_light(PathVertex point, dvec3 light) {
  work.states.states[pixel_index].sum += light;
  if (point.depth == 0u || is_diffuse_path(point)) work.states.states[pixel_index].diffuse += light;
}

uint waiting_count = 0u;  // on the pixel's stack
bool is_crowded = false;  // whether more would wait than there is room for

void add_waiting(FoundVertex found) {
  if (waiting_count < work.max_waiting) {
    work.waiting.found[pixel_index * work.max_waiting + waiting_count++] = found;
  } else {
    is_crowded = true;
  }
}

// Software devices end all loops of a thread after some turns, in silence.
void note_cut_off(bool is_cut_off) {
  uint turns = 0u;
  uint wanted = min(tile_count, 2u);
  while (turns < wanted) ++turns;
  if (is_cut_off || turns < wanted) work.states.states[pixel_index].is_cut_off = 1u;
}

shared uint group_counts[kCounters];

void start_counts() {
  if (gl_LocalInvocationIndex < kCounters) group_counts[gl_LocalInvocationIndex] = 0u;
  barrier();
}

void add_counts() {
  barrier();
  if (gl_LocalInvocationIndex < kCounters && group_counts[gl_LocalInvocationIndex] > 0u) {
    atomicAdd(inputs.light.counters.counts[gl_LocalInvocationIndex], group_counts[gl_LocalInvocationIndex]);
  }
}
