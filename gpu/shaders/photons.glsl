// Light that photons bring: the search of rt/photons/photon_map.h and photon_query.h, and PhotonPass. Maps lie as
// gpu/light/gpu_photons.h puts them. Needs reals.glsl, surface_point.glsl and reflection_terms.glsl.

struct PhotonPlace {
  vec3 position;  // ray space
  uint facing;
};
struct PhotonLight {
  uint direction;
  vec3 flux;
};
layout(buffer_reference, scalar) readonly buffer PhotonStarts {
  uint starts[];
};
layout(buffer_reference, scalar) readonly buffer PhotonPlaces {
  PhotonPlace positions[];
};
layout(buffer_reference, scalar) readonly buffer PhotonLights {
  PhotonLight lights[];
};

struct PhotonMap {
  PhotonStarts starts;
  PhotonPlaces positions;
  PhotonLights lights;
  dvec3 origin;  // ray space is (world - origin) * scale
  double scale;
  double radius;  // metres
  double flux_unit;
  double cells_per_unit;
  uint photons;  // 0: nothing lies at the addresses
  uint last_slot;
  uint row_step;
  uint layer_step;
};
const uint kPhotonMaps = 4u;
layout(buffer_reference, scalar) readonly buffer PhotonMaps {
  PhotonMap maps[kPhotonMaps];  // caustic, global, and the two sparse ones
  double near;
  double footprint;
};

// Photons about a place on a surface, which next_photon finds one by one.
struct PhotonSearch {
  vec3 high;  // the place in ray space: as floats, and what they leave out
  vec3 low;
  vec3 normal;
  vec3 in_cell;
  float radius2;
  float inverse_radius2;
  float flatness;
  float thickness;  // in cells, of the slab about the surface's plane that rows may touch
  uint layer;
  uint cell;
  uint row;   // of kPhotonRows: the next one
  uint next;  // photons of this row that were not looked at yet
  uint end;
  uint index;    // of the photon found
  float weight;  // Epanechnikov's 1 - d^2 / r^2
};
const uint kPhotonRows = 9u;
const float kPhotonSlack = 4e-6;  // lengths in cells are a little too long, so that no rounding loses a photon

precise vec3 fold_octahedron(int x, int y, float steps) {
  precise vec2 d = vec2(x, y) * (1.0 / steps);
  precise float z = 1.0 - abs(d.x) - abs(d.y);
  float fold = max(-z, 0.0);
  precise vec3 folded = vec3(d.x - (d.x < 0.0 ? -fold : fold), d.y - (d.y < 0.0 ? -fold : fold), z);
  return folded;
}

vec3 photon_facing(uint packed) {  // not of unit length
  return fold_octahedron(bitfieldExtract(int(packed), 0, 12), bitfieldExtract(int(packed), 12, 12), 2047.0);
}

vec3 photon_direction(uint packed) {
  return exact_unit(fold_octahedron(bitfieldExtract(int(packed), 0, 16), bitfieldExtract(int(packed), 16, 16), 32767.0));
}

PhotonSearch no_search() {
  return PhotonSearch(vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0), 0.0, 0.0, 0.0, 0.0, 0u, 0u, kPhotonRows, 0u, 0u, 0u, 0.0);
}

// `position`, `normal`: of the true surface, world. `radius`: metres, at most the map's own.
PhotonSearch search_photons(PhotonMap map, dvec3 position, dvec3 normal, uint layer, double radius) {
  const double kCenter = 1073741824.0lf;  // 2^30 cells each way
  PhotonSearch search = no_search();
  if (map.photons == 0u) return search;
  precise dvec3 at = (position - map.origin) * map.scale;
  precise dvec3 cell = at * map.cells_per_unit + kCenter;
  // Comparisons with what is no number are false.
  bvec3 inside_low = greaterThan(cell, dvec3(1.0lf));
  bvec3 inside_high = lessThan(cell, dvec3(2.0lf * kCenter - 2.0lf));
  if (!(all(inside_low) && all(inside_high))) return search;
  uvec3 whole = uvec3(cell);
  search.in_cell = vec3(cell - dvec3(whole));
  search.cell = whole.x + whole.y * map.row_step + whole.z * map.layer_step;
  search.high = vec3(at);
  precise dvec3 low = at - dvec3(search.high);
  search.low = vec3(low);
  search.normal = vec3(normal);
  search.layer = layer;
  precise double scaled = max(radius * map.scale, 5.9604644775390625e-8lf);  // 2^-24
  precise double radius2 = scaled * scaled;
  precise double flatness = 0.2lf * scaled + 2.0lf * 1.1920928955078125e-7lf;
  search.radius2 = float(radius2);
  search.inverse_radius2 = float(1.0lf / radius2);
  search.flatness = float(flatness);
  search.thickness = float(flatness * map.cells_per_unit) + 0.5 * (abs(search.normal.y) + abs(search.normal.z)) +
                     4.0 * kPhotonSlack;
  search.row = 0u;
  return search;
}

// From a place in its cell to the nearest point of the cell one step on.
float cell_gap(float to, float in_cell) {
  return to < 0.0 ? in_cell : to > 0.0 ? 1.0 - in_cell : 0.0;
}

// The photons of the next row, cut to the cells that come within the radius and near the surface's plane.
void start_row(PhotonMap map, inout PhotonSearch search) {
  int y = int(search.row % 3u) - 1;
  int z = int(search.row / 3u) - 1;
  ++search.row;
  search.next = 0u;
  search.end = 0u;
  float gap_y = cell_gap(float(y), search.in_cell.y);
  float gap_z = cell_gap(float(z), search.in_cell.z);
  float width2 = 1.0 - gap_y * gap_y - gap_z * gap_z;
  if (!(width2 > 0.0)) return;
  float width = sqrt(width2);
  float inverse_slope = 1.0 / (abs(search.normal.x) < kPhotonSlack ? kPhotonSlack : search.normal.x);
  // How far along x the row's box may touch the slab about the plane.
  float center = search.normal.y * (float(y) + (0.5 - search.in_cell.y)) +
                 search.normal.z * (float(z) + (0.5 - search.in_cell.z));
  float one = (-search.thickness - center) * inverse_slope;
  float other = (search.thickness - center) * inverse_slope;
  float low = max(-width, min(one, other));
  float high = min(width, max(one, other));
  if (!(low <= high)) return;
  // 0, 1 or 2 of the three cells about the place: truncation rounds down what is positive.
  uint first = uint(clamp(low + (1.0 + search.in_cell.x), 0.0, 2.0));
  uint last = uint(clamp(high + (1.0 + search.in_cell.x), 0.0, 2.0));
  uint slot = (search.cell - 1u + uint(y) * map.row_step + uint(z) * map.layer_step + first) & map.last_slot;
  search.next = map.starts.starts[slot];
  search.end = map.starts.starts[slot + (last - first) + 1u];
}

// Whether a photon counts, and its weight: in the CPU's steps, so that the same ones do.
bool photon_counts(PhotonPlace photon, PhotonSearch search, out float weight) {
  precise vec3 offset = photon.position - search.high - search.low;
  precise float distance2 = exact_dot(offset, offset);
  precise float kernel = 1.0 - distance2 * search.inverse_radius2;
  weight = kernel;
  if (photon.facing >> 24 != search.layer || !(distance2 < search.radius2)) return false;
  if (!(abs(exact_dot(offset, search.normal)) <= search.flatness)) return false;
  vec3 facing = photon_facing(photon.facing);
  precise float cosine = exact_dot(facing, search.normal);
  precise float cosine2 = cosine * cosine;
  precise float least = 0.25 * exact_dot(facing, facing);
  return cosine > 0.0 && cosine2 >= least;
}

// Finds the next photon that counts; false past the last one, or where a device ended the loop: see search_is_done.
bool next_photon(PhotonMap map, inout PhotonSearch search) {
  while (true) {
    if (search.next < search.end) {
      search.index = search.next++;
      if (photon_counts(map.positions.positions[search.index], search, search.weight)) return true;
    } else if (search.row < kPhotonRows) {
      start_row(map, search);
    } else {
      return false;
    }
  }
  return false;
}

bool search_is_done(PhotonSearch search) {
  return search.row == kPhotonRows && search.next == search.end;
}

// W/m^2 per flux unit.
double photon_density(PhotonMap map, double radius) {
  return radius > 0.0lf ? 2.0lf / (kPi * radius * radius) * map.flux_unit : 0.0lf;
}

// The radiance towards the viewer that `terms`, of the lobes that no ray follows alone, make of the photons about `surface`.
// Never NaN. `done` becomes false where a device ended the search too early.
dvec3 gather_photons(PhotonMap map, double radius, SurfacePoint surface, ReflectionTerms terms, dvec3 shading_normal,
                     inout bool done) {
  if (!terms.specular && terms.diffuse == vec3(0.0)) return dvec3(0.0lf);
  bool leans = shading_normal != surface.geometric_normal;
  PhotonSearch search = search_photons(map, surface.position, surface.geometric_normal, surface.layer, radius);
  dvec3 sum = dvec3(0.0lf);
  while (next_photon(map, search)) {
    PhotonLight light = map.lights.lights[search.index];
    precise vec3 reflected = (search.weight * light.flux) * reflected_by_terms(terms, leans, photon_direction(light.direction));
    sum += dvec3(reflected);
  }
  done = done && search_is_done(search);
  dvec3 light = photon_density(map, radius) * sum;
  return is_finite(light.r + light.g + light.b) ? light : dvec3(0.0lf);
}

// As PhotonMaps::sparse_radius.
double sparse_radius(PhotonMaps photons, double widest, double distance, double pdf) {
  double narrow = pdf > 0.0lf ? min(1.0lf, 1.0lf / sqrt(kPi * pdf)) : 1.0lf;
  return clamp(photons.footprint * distance * narrow, min(photons.maps[1].radius, widest), widest);
}

// Which maps photons are looked up in, and within how many metres.
struct PhotonUse {
  uint maps;  // the first so many
  double radius[kPhotonMaps];
};

// As PhotonPass::scatter, of one vertex of a path. `gathers`: whether rays follow all lobes, as far as `gather_reach`.
PhotonUse photons_of_path(PhotonMaps photons, bool gathers, double gather_reach, double distance, double pdf) {
  PhotonUse use;
  bool gathers_near = is_finite(gather_reach);
  use.maps = gathers_near ? kPhotonMaps : gathers ? 1u : 2u;
  for (uint i = 0u; i < kPhotonMaps; ++i) {
    double widest = photons.maps[i].radius;
    use.radius[i] = i < 2u ? widest : sparse_radius(photons, widest, distance, pdf);
  }
  return use;
}

dvec3 light_by_photons(PhotonMaps photons, PhotonUse use, SurfacePoint surface, ReflectionTerms terms, dvec3 shading_normal,
                       inout bool done) {
  dvec3 light = dvec3(0.0lf);
  uint i = 0u;
  for (; i < use.maps; ++i) {
    PhotonMap map = photons.maps[i];
    light += gather_photons(map, use.radius[i], surface, terms, shading_normal, done);
  }
  done = done && i == use.maps;
  return light;
}
