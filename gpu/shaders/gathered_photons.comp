// A test's: light that photons bring to some places.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "reals.glsl"
#include "surface_point.glsl"
#include "reflection_terms.glsl"
#include "photons.glsl"

struct Query {
  dvec3 position;
  dvec3 geometric_normal;
  dvec3 shading_normal;
  dvec3 previous_position;
  double previous_pdf;
  double gather_reach;
  double radius;
  ReflectionTerms terms;
  uint layer;
  uint which;  // the map; or past the last one: all of them, as paths gather them
  uint gathers;
  uint padding;
};
struct Answer {
  dvec3 light;
  uint found;
  uint done;
};
layout(buffer_reference, scalar) readonly buffer Queries {
  Query queries[];
};
layout(buffer_reference, scalar) writeonly buffer Answers {
  Answer answers[];
};
layout(push_constant, scalar) uniform Constants {
  Queries of;
  Answers to;
  PhotonMaps photons;
  uint64_t count;
};

void main() {
  uint64_t i = thread_index();
  if (i >= count) return;
  Query query = of.queries[uint(i)];
  SurfacePoint surface;
  surface.position = query.position;
  surface.geometric_normal = query.geometric_normal;
  surface.layer = query.layer;
  bool done = true;
  uint found = 0u;
  dvec3 light;
  if (query.which < kPhotonMaps) {
    PhotonMap map = photons.maps[query.which];
    light = gather_photons(map, query.radius, surface, query.terms, query.shading_normal, done);
    PhotonSearch search = search_photons(map, surface.position, surface.geometric_normal, surface.layer, query.radius);
    while (next_photon(map, search)) ++found;
    done = done && search_is_done(search);
  } else {
    PhotonUse use = photons_of_path(photons, query.gathers != 0u, query.gather_reach,
                                    distance(query.position, query.previous_position), query.previous_pdf);
    light = light_by_photons(photons, use, surface, query.terms, query.shading_normal, done);
  }
  to.answers[uint(i)] = Answer(light, found, done ? 1u : 0u);
}
