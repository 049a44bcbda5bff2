// Rays through surfaces that cover in part what is behind them: rt/trace/coverage_traversal.cpp.
// Needs trace.glsl, sampler.glsl, surfaces.glsl, materials.glsl and path.glsl.

const int kMaxPassed = 1000;
const uint kMaxLevel = 12u;  // surfaces of one plane that a ray meets; the CPU finishes those of more

struct SurfacePlane {
  dvec3 position;
  dvec3 normal;  // unit length, on the viewer's side; zero: none
  double tolerance;
};
const SurfacePlane kNoPlane = SurfacePlane(dvec3(0.0lf), dvec3(0.0lf), 0.0lf);

// A surface that covers in part, and how much.
struct CoveringLayer {
  uint surface;
  double coverage;
};

// What a ray needs to find such surfaces, nearest first and by id where they lie in one plane.
struct LayerSearch {
  SceneTrees tree;
  SurfaceTables surfaces;
  Materials materials;
  TracedRay ray;     // goes on behind what it has met
  SurfacePlane end;  // what lies behind it is hidden
  SurfacePlane plane;  // of the first of `layers`
  CoveringLayer layers[kMaxLevel];  // of one plane
  uint count;
  uint visited;         // of `layers`
  bool has_ahead;  // whether `ahead`, which lies behind `layers`, was met
  CoveringLayer ahead;
  SurfacePlane ahead_plane;
  int passed;
  bool is_over;        // nothing comes after `layers` and `ahead`
  bool is_cut;         // for it has met too many
  bool is_unfinished;  // more of one plane than there is room for
};

double coplanar_tolerance(Placement placed, WorldTriangle triangle, double offset) {
  dvec3 farthest = max(abs(dvec3(placed.positions.positions[triangle.corners.x])),
                       max(abs(dvec3(placed.positions.positions[triangle.corners.y])),
                           abs(dvec3(placed.positions.positions[triangle.corners.z]))));
  dvec3 stored = abs(placed.to_world[0]) * farthest.x + abs(placed.to_world[1]) * farthest.y + abs(placed.to_world[2]) * farthest.z;
  return offset + kOriginSteps * kFloatStep * dot(abs(triangle.normal), stored);
}

// The plane of a surface where a ray meets it, and how much it covers there.
SurfacePlane plane_at(SurfaceTable table, Materials materials, uint surface, TracedRay ray, out double coverage) {
  WorldTriangle triangle = load_triangle(table, surface);
  Placement placed = table.placements.placements[triangle.placement];
  SurfacePoint point = meet_loaded(table, triangle, placed, ray.origin, ray.direction);
  coverage = evaluate_alpha(materials, point.material, point.uv, point.color.a);
  return SurfacePlane(point.position, point.geometric_normal, coplanar_tolerance(placed, triangle, point.offset));
}

// Metres along the normal of `first`, whose viewer they are both seen by.
double distance_behind(SurfacePlane first, SurfacePlane other) {
  return dot(first.position - other.position, first.normal);
}

double reach_past(SurfacePlane end, TracedRay ray, double space_scale) {
  const double kMinCosine = 1.0lf / 1024.0lf;
  double sizes = 4.0lf * kOriginSteps * kFloatStep / space_scale;
  double cosine = max(abs(dot(end.normal, ray.direction)), kMinCosine);
  double distance = max(dot(end.position - ray.origin, ray.direction), 0.0lf);
  return min(ray.reach, distance * (1.0lf + kOriginSteps * kFloatStep) + (sizes + end.tolerance) / cosine);
}

// `behind`: a surface that hides all behind it; kNoSurface where only the ray's reach ends it.
LayerSearch start_search(SceneTrees tree, SurfaceTables surfaces, Materials materials, TracedRay ray, uint behind) {
  LayerSearch search;
  search.tree = tree;
  search.surfaces = surfaces;
  search.materials = materials;
  search.ray = ray;
  search.ray.passed = kNothingPassed;
  search.end = kNoPlane;
  if (behind != kNoSurface) {
    double covers;
    search.end = plane_at(surfaces.table, materials, behind, ray, covers);
    search.ray.reach = reach_past(search.end, ray, surfaces.table.space_scale);
  }
  search.count = 0u;
  search.visited = 0u;
  search.has_ahead = false;
  search.passed = 0;
  search.is_over = false;
  search.is_cut = false;
  search.is_unfinished = false;
  return search;
}

// Counts a surface that a ray has passed, and came `gained` metres farther by it; false when it is one too many.
bool passes_on(inout int passed, double coverage, double gained) {
  if (!(coverage > 0.0lf) && gained > 0.0lf) return true;
  return ++passed <= kMaxPassed;
}

// Puts a surface among those of its plane, by id. Behind what covers wholly, only more of its plane matters.
void add_layer(inout LayerSearch search, SurfacePlane plane, CoveringLayer layer) {
  if (search.count == 0u) search.plane = plane;
  if (layer.coverage >= 1.0lf) {
    search.ray.reach = reach_past(search.plane, search.ray, search.surfaces.table.space_scale);
  }
  if (search.count == kMaxLevel) {
    search.is_unfinished = true;
    return;
  }
  uint at = search.count++;
  for (; at > 0u && search.layers[at - 1u].surface > layer.surface; --at) search.layers[at] = search.layers[at - 1u];
  search.layers[at] = layer;
}

// Finds the surfaces of the next plane.
void find_level(inout LayerSearch search) {
  search.count = 0u;
  search.visited = 0u;
  if (search.has_ahead) add_layer(search, search.ahead_plane, search.ahead);
  search.has_ahead = false;
  double scale = search.surfaces.table.space_scale;
  while (!search.is_over && !search.has_ahead) {
    NearestHit hit = closest_hit(search.tree.tree, search.ray);
    if (hit.surface == kNoSurface) {
      search.is_over = true;
      return;
    }
    CoveringLayer layer;
    layer.surface = hit.surface;
    SurfacePlane plane = plane_at(search.surfaces.table, search.materials, hit.surface, search.ray, layer.coverage);
    bool is_hidden = search.end.normal != dvec3(0.0lf) &&
                     distance_behind(search.end, plane) > search.end.tolerance + plane.tolerance;
    bool is_level = search.count == 0u ||
                    abs(distance_behind(search.plane, plane)) <= search.plane.tolerance + plane.tolerance;
    double gained = hit.distance - search.ray.passed.distance;
    // As far apart as rounding puts two triangles' common edge (kSameEdge of rt/trace/ray_scene.cpp).
    double edge = 8.0lf * kFloatStep * max(hit.distance, 1.0lf / scale);
    search.ray.passed = Passed(hit.distance, hit.surface, hit.first_surface, edge);
    if (!passes_on(search.passed, layer.coverage, gained)) search.is_over = search.is_cut = true;
    if (is_hidden && search.count > 0u) return;
    if (is_hidden) continue;
    if (is_level) {
      add_layer(search, plane, layer);
    } else {
      search.ahead = layer;
      search.ahead_plane = plane;
      search.has_ahead = true;
    }
  }
}

// The next surface along the ray; false: there is none. Whoever stops asking has ended the ray.
bool next_layer(inout LayerSearch search, out CoveringLayer layer) {
  if (search.visited == search.count && (search.has_ahead || !search.is_over)) find_level(search);
  if (search.visited == search.count) return false;
  layer = search.layers[search.visited++];
  return true;
}

// What became of a ray beside what it found.
struct CoverageNotes {
  uint cut;  // rays that ended among too many surfaces
  bool is_unfinished;
};

// `goes_on`: past all that it found.
void note_end(LayerSearch search, bool goes_on, inout CoverageNotes notes) {
  if (search.is_cut && goes_on) ++notes.cut;
  if (search.is_unfinished) notes.is_unfinished = true;
}

// The surface a ray meets first: those of `alpha_tested` with the probability that they cover.
uint closest_by_chance(SceneTrees opaque, SceneTrees alpha_tested, SurfaceTables surfaces, Materials materials, TracedRay ray,
                       inout Sampler random, inout CoverageNotes notes) {
  uint behind = closest_surface(opaque.tree, ray);
  LayerSearch search = start_search(alpha_tested, surfaces, materials, ray, behind);
  uint met = kNoSurface;
  CoveringLayer layer;
  while (met == kNoSurface && next_layer(search, layer)) {
    bool passes = layer.coverage < 1.0lf && !(next_one(random) < layer.coverage);
    if (!passes) met = layer.surface;
  }
  note_end(search, met == kNoSurface, notes);
  return met != kNoSurface ? met : behind;
}

// The fraction of light that gets through to the end of the ray: 0 behind anything opaque.
double passed_fraction(SceneTrees opaque, SceneTrees alpha_tested, SurfaceTables surfaces, Materials materials, TracedRay ray,
                       inout CoverageNotes notes) {
  if (is_blocked(opaque.tree, ray)) return 0.0lf;
  LayerSearch search = start_search(alpha_tested, surfaces, materials, ray, kNoSurface);
  float passed = 1.0;
  CoveringLayer layer;
  while (passed > 0.0 && next_layer(search, layer)) passed *= float(1.0lf - layer.coverage);
  note_end(search, passed > 0.0, notes);
  return double(passed);
}
