// What the kernels that trace photons have in common: their input, and what they keep of every photon between them. A photon
// that is scattered may go on as several: those that are under way wait in a queue of its own, and the first of them moves on to
// the next surface. So each one's numbers and what it leaves come in the order of PhotonTracer, whatever is traced beside it.
// Needs all that makes points of surfaces, materials and BSDFs.

struct PhotonFlight {
  Sampler random;
  dvec3 position;  // world: where it was scattered last
  dvec3 origin;    // world: off that surface
  dvec3 direction;
  dvec3 flux;
  Media media;    // that it flies through
  dvec3 center;   // of its light, and how far that reaches (PhotonStart)
  double range;
  uint bounces;
  bool followed;  // has met followed lobes only
  bool endless;   // still comes from without the scene
};
layout(buffer_reference, scalar) buffer PhotonFlights {
  PhotonFlight flights[];
};

// Where flux arrives, as its light sees it: FluxArrival of rt/photons/adjoint_bsdf.h.
struct FluxArrival {
  SurfacePoint surface;
  MaterialPoint material;
  Bsdf bsdf;
  Bsdf plain;  // by the true surface's normal; only where it is not flat
  bool flat_normals;
};

// Of a lobe of one direction.
const uint kMaxDirections = 8u;
struct FluxDirections {
  dvec3 direction[kMaxDirections];
  dvec3 weight[kMaxDirections];
  dvec3 sum;
  uint count;
};

// Of a photon.
struct PhotonState {
  uint first;      // of its flights in the queue
  uint waiting;    // how many these are
  uint met;        // the surface that the first of them meets
  uint scatters;   // whether it does there
  uint rays;
  uint sent;
  uint lost;       // flights that were still under way after so many bounces
  uint is_cut_off; // a device ended a loop, more waited than there is room for, or a ray is none that the CPU traces
  FluxArrival arrival;
  dvec3 weights[2 * kLobes];  // of the lobes of both its BSDFs
  FluxDirections directions[3];  // of kReflection, kTransmission and kCoat
};
layout(buffer_reference, scalar) buffer PhotonStates {
  PhotonState states[];
};

// What the CPU reads of each photon that was under way.
struct PhotonStatus {
  uint waiting;
  uint rays;
  uint sent;
  uint lost;
  uint is_cut_off;
};
layout(buffer_reference, scalar) writeonly buffer PhotonStatuses {
  PhotonStatus statuses[];
};

// Photon of rt/photons/photon_map.h.
struct KeptPhoton {
  vec3 position;
  uint facing;
  uint direction;
  vec3 flux;
  float traveled;
  uint kind;
};
const uint kNotKept = 0u;
const uint kKeptCaustic = 1u;
const uint kKeptGlobal = 2u;
layout(buffer_reference, scalar) writeonly buffer KeptPhotons {
  KeptPhoton kept[];
};
layout(buffer_reference, scalar) readonly buffer LivePhotons {
  uint numbers[];
};

struct PhotonInput {
  SceneTrees scene;
  SurfaceTables surfaces;
  Materials materials;
  uint64_t lights;
  PhotonStates states;
  PhotonFlights flights;
  LivePhotons live;
  KeptPhotons kept;
  PhotonStatuses statuses;
  uint64_t stream;
  uint64_t first;   // index of photon 0
  double fraction;  // of the lights' flux that a photon carries
  double glossy_cutoff;
  double flux_unit;
  uint max_bounces;
  uint max_flights;  // of a photon
  uint caustics_only;
  uint padding;
};
layout(buffer_reference, scalar) readonly buffer PhotonInputs {
  PhotonInput photons;
};
layout(push_constant, scalar) uniform Constants {
  PhotonInputs inputs;
  uint live_count;
  uint round;  // since the CPU looked
};

PhotonInput work;
uint live_index;
uint photon;

// Whether this thread has a photon that is under way; sets what is known of it.
bool start_photon() {
  live_index = uint(thread_index());
  if (live_index >= live_count) return false;
  work = inputs.photons;
  photon = work.live.numbers[live_index];
  return true;
}

bool is_under_way() {
  return work.states.states[photon].waiting > 0u && work.states.states[photon].is_cut_off == 0u;
}

uint first_flight() {
  return photon * work.max_flights + work.states.states[photon].first;
}

void drop_first_flight() {
  work.states.states[photon].first = (work.states.states[photon].first + 1u) % work.max_flights;
  work.states.states[photon].waiting -= 1u;
}

// Software devices end all loops of a thread after some turns, in silence.
void note_cut_off(bool is_cut_off) {
  uint turns = 0u;
  uint wanted = min(live_count, 2u);
  while (turns < wanted) ++turns;
  if (is_cut_off || turns < wanted) work.states.states[photon].is_cut_off = 1u;
}

double sum_of(dvec3 v) {
  return v.r + v.g + v.b;
}

// False for no light at all and for what is not a number.
bool carries_light(dvec3 flux) {
  double sum = sum_of(flux);
  return sum > 0.0lf && is_finite(sum);
}
