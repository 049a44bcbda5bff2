// A test's: bsdf.glsl at some surfaces.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "reals.glsl"
#include "sampling.glsl"
#include "surface_point.glsl"
#include "textures.glsl"
#include "materials.glsl"
#include "microfacets.glsl"
#include "plain_bsdf.glsl"
#include "sheen.glsl"
#include "thin_film.glsl"
#include "anisotropic_facets.glsl"
#include "extended_bsdf.glsl"
#include "bsdf.glsl"
#include "test_surfaces.glsl"

struct BsdfUse {
  PlainSurface surface;
  PlainPoint material;
  dvec3 to_light;
  dvec2 u;
  double glossy_cutoff;
  uint lobe;
  uint flux;
  uint summed;
  uint padding;
};
struct FoundBsdf {
  dvec3 values[5];
  double pdfs[5];
  dvec3 value;
  double pdf;
  dvec3 sum;
  dvec3 weight;
  dvec3 light_normal;
  double roughness;
  dvec3 direction;
  dvec3 sample_weight;
  double sample_pdf;
  uint has_sample;
  uint is_present;
  uint is_delta;
  uint is_followed;
};
layout(buffer_reference, scalar) readonly buffer Uses {
  BsdfUse uses[];
};
layout(buffer_reference, scalar) writeonly buffer FoundBsdfs {
  FoundBsdf bsdfs[];
};
layout(push_constant, scalar) uniform Constants {
  Uses of;
  FoundBsdfs found;
  Materials materials;
  uint count;
};

void main() {
  uint i = uint(thread_index());
  if (i >= count) return;
  BsdfUse use = of.uses[i];
  Bsdf b = make_bsdf(material_of(materials, use.material), surface_of(use.surface), use.flux != 0u);
  Scattering scattering = bsdf_scattering(b, use.to_light);
  FoundBsdf each;
  each.values = scattering.value;
  each.pdfs = scattering.pdf;
  each.value = scattering.value[use.lobe];
  each.pdf = scattering.pdf[use.lobe];
  if (!b.extended) each.value = plain_lobe(b.plain, use.lobe, use.to_light, each.pdf);  // else what was summed up
  each.sum = bsdf_sum(b, use.summed, use.to_light);
  each.weight = bsdf_weight(b, use.lobe);
  each.light_normal = bsdf_light_normal(b);
  each.roughness = bsdf_roughness(b, use.lobe);
  BsdfSample s;
  each.has_sample = uint(bsdf_sample(b, use.lobe, use.u, s));
  each.direction = s.direction;
  each.sample_weight = s.weight;
  each.sample_pdf = s.pdf;
  each.is_present = uint(bsdf_present(b, use.lobe));
  each.is_delta = uint(bsdf_is_delta(b, use.lobe));
  each.is_followed = uint(is_followed(b, use.lobe, use.glossy_cutoff));
  found.bsdfs[i] = each;
}
