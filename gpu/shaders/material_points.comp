// A test's: materials.glsl and media.glsl at some surface points.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "threads.glsl"

#include "reals.glsl"
#include "surface_point.glsl"
#include "textures.glsl"
#include "materials.glsl"
#include "media.glsl"
#include "test_surfaces.glsl"

struct MaterialUse {
  PlainSurface surface;
  dvec3 direction;
  dvec3 throughput;
  Media media;
  double u;
  double metres;
};
struct FoundPoint {
  dvec3 base_color;
  double metallic;
  double roughness;
  double transmission;
  double ior;
  dvec3 emission;
  double alpha;
  double occlusion;
  dvec3 absorption;
  dvec3 normal;
  double ior_spread;
  uint unlit;
  uint solid;
  uint disperses;
  uint extended;
  double specular;
  dvec3 specular_color;
  double clearcoat;
  double clearcoat_roughness;
  dvec3 clearcoat_normal;
  dvec3 sheen_color;
  double sheen_roughness;
  double anisotropy;
  dvec3 anisotropy_direction;
  double iridescence;
  double iridescence_ior;
  double iridescence_nm;
  double diffuse_transmission;
  dvec3 diffuse_transmission_color;
  double alpha_alone;
  dvec3 normal_alone;
  dvec3 coat_normal_alone;
  double chosen_ior;
  uint chosen_channel;
  float chosen_scale;
  dvec3 to_point;
  Media towards;
  dvec3 to_light;
  uint leads_in;
  uint carries_channels;
};
layout(buffer_reference, scalar) readonly buffer Uses {
  MaterialUse uses[];
};
layout(buffer_reference, scalar) writeonly buffer FoundPoints {
  FoundPoint points[];
};
layout(push_constant, scalar) uniform Constants {
  Uses of;
  FoundPoints found;
  Materials materials;
  uint count;
};

void main() {
  uint i = uint(thread_index());
  if (i >= count) return;
  MaterialUse use = of.uses[i];
  SurfacePoint surface = surface_of(use.surface);
  MaterialPoint point = evaluate_material(materials, surface);
  FoundPoint each;
  each.base_color = point.base_color;
  each.metallic = point.metallic;
  each.roughness = point.roughness;
  each.transmission = point.transmission;
  each.ior = point.ior;
  each.emission = point.emission;
  each.alpha = point.alpha;
  each.occlusion = point.occlusion;
  each.absorption = point.absorption;
  each.normal = point.normal;
  each.ior_spread = point.ior_spread;
  each.unlit = uint(point.unlit);
  each.solid = uint(point.solid);
  each.disperses = uint(disperses(point));
  each.extended = uint(point.extended);
  each.specular = point.extensions.specular;
  each.specular_color = point.extensions.specular_color;
  each.clearcoat = point.extensions.clearcoat;
  each.clearcoat_roughness = point.extensions.clearcoat_roughness;
  each.clearcoat_normal = point.extensions.clearcoat_normal;
  each.sheen_color = point.extensions.sheen_color;
  each.sheen_roughness = point.extensions.sheen_roughness;
  each.anisotropy = point.extensions.anisotropy;
  each.anisotropy_direction = point.extensions.anisotropy_direction;
  each.iridescence = point.extensions.iridescence;
  each.iridescence_ior = point.extensions.iridescence_ior;
  each.iridescence_nm = point.extensions.iridescence_nm;
  each.diffuse_transmission = point.extensions.diffuse_transmission;
  each.diffuse_transmission_color = point.extensions.diffuse_transmission_color;
  each.alpha_alone = evaluate_alpha(materials, surface.material, surface.uv, surface.color.a);
  each.normal_alone = normal_to_shade_with(materials, surface);
  each.coat_normal_alone = coat_normal_to_shade_with(materials, surface);
  each.to_point = transmittance_to(use.media, surface, point, min(use.metres, 1e9lf));
  each.towards = media_towards(use.media, surface, point, use.direction);
  each.to_light = transmittance_to_light(use.media, surface, point, use.direction, use.metres);
  each.leads_in = uint(leads_into_solid(surface, point, use.direction));
  each.carries_channels = uint(carries_channels(use.throughput));
  choose_channel(point, use.throughput, use.u);
  each.chosen_ior = point.ior;
  each.chosen_channel = point.channel;
  each.chosen_scale = point.channel_scale;
  found.points[i] = each;
}
