// Materials, as gpu/light/gpu_materials.h lays them out, and what they are where a surface was met: rt/materials/material_point.h.
// Needs reals.glsl, surface_point.glsl and textures.glsl.

const uint kOpaque = 0u;
const uint kMask = 1u;
const uint kBlend = 2u;

// Indices into Material::textures.
const uint kBaseColorTexture = 0u;
const uint kMetallicRoughnessTexture = 1u;
const uint kNormalTexture = 2u;
const uint kEmissiveTexture = 3u;
const uint kOcclusionTexture = 4u;
const uint kTransmissionTexture = 5u;
const uint kMaterialTextures = 6u;
const uint kSrgbMaterialTextures = (1u << kBaseColorTexture) | (1u << kEmissiveTexture);

// Indices into MaterialExtensions::textures.
const uint kSpecularTexture = 0u;
const uint kSpecularColorTexture = 1u;
const uint kClearcoatTexture = 2u;
const uint kClearcoatRoughnessTexture = 3u;
const uint kClearcoatNormalTexture = 4u;
const uint kSheenColorTexture = 5u;
const uint kSheenRoughnessTexture = 6u;
const uint kAnisotropyTexture = 7u;
const uint kIridescenceTexture = 8u;
const uint kIridescenceThicknessTexture = 9u;
const uint kDiffuseTransmissionTexture = 10u;
const uint kDiffuseTransmissionColorTexture = 11u;
const uint kExtensionTextures = 12u;
const uint kSrgbExtensionTextures =
    (1u << kSpecularColorTexture) | (1u << kSheenColorTexture) | (1u << kDiffuseTransmissionColorTexture);

struct Material {
  dvec3 absorption;  // as absorption_of() has it
  TextureRef textures[6];
  vec4 base_color;
  vec3 emissive;
  float metallic;
  float roughness;
  float normal_scale;
  float occlusion_strength;
  float transmission;
  float ior;
  float thickness;
  float alpha_cutoff;
  uint alpha_mode;
  uint shows_both_sides;
  uint unlit;
  int extensions;  // -1: none
  uint padding;
};
struct MaterialExtensions {
  dvec2 anisotropy_rotation;  // cosine and sine
  TextureRef textures[12];
  vec3 specular_color;
  vec3 sheen_color;
  vec3 diffuse_transmission_color;
  float specular;
  float clearcoat;
  float clearcoat_roughness;
  float clearcoat_normal_scale;
  float sheen_roughness;
  float anisotropy;
  float iridescence;
  float iridescence_ior;
  float iridescence_min_nm;
  float iridescence_max_nm;
  float dispersion;
  float diffuse_transmission;
  uint padding;
};
layout(buffer_reference, scalar) readonly buffer MaterialItems {
  Material items[];
};
layout(buffer_reference, scalar) readonly buffer ExtensionItems {
  MaterialExtensions items[];
};
layout(buffer_reference, scalar) readonly buffer SheenAlbedos {
  double albedo[];  // [root of the roughness][root of the cosine], kSheenSteps of each
};
layout(buffer_reference, scalar) readonly buffer Materials {
  Textures textures;
  MaterialItems all;
  ExtensionItems extensions;
  SheenAlbedos sheen;
};

struct ExtensionPoint {
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
  SheenAlbedos sheen;
};

const uint kAllChannels = 3u;

struct MaterialPoint {
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
  float channel_scale;
  uint channel;
  bool unlit;
  bool solid;
  bool extended;  // whether its extensions have an effect
#ifndef PLAIN_MATERIALS
  ExtensionPoint extensions;
#endif
};

ExtensionPoint plain_extensions() {
  ExtensionPoint point;
  point.specular = 1.0lf;
  point.specular_color = dvec3(1.0lf);
  point.clearcoat = 0.0lf;
  point.clearcoat_roughness = 0.0lf;
  point.clearcoat_normal = dvec3(0.0lf, 0.0lf, 1.0lf);
  point.sheen_color = dvec3(0.0lf);
  point.sheen_roughness = 0.0lf;
  point.anisotropy = 0.0lf;
  point.anisotropy_direction = dvec3(0.0lf);
  point.iridescence = 0.0lf;
  point.iridescence_ior = 1.3lf;
  point.iridescence_nm = 0.0lf;
  point.diffuse_transmission = 0.0lf;
  point.diffuse_transmission_color = dvec3(1.0lf);
  point.sheen = SheenAlbedos(uvec2(0u));
  return point;
}

MaterialPoint plain_material() {
  MaterialPoint point;
  point.base_color = dvec3(1.0lf);
  point.metallic = 0.0lf;
  point.roughness = 1.0lf;
  point.transmission = 0.0lf;
  point.ior = 1.5lf;
  point.emission = dvec3(0.0lf);
  point.alpha = 1.0lf;
  point.occlusion = 1.0lf;
  point.absorption = dvec3(0.0lf);
  point.normal = dvec3(0.0lf, 0.0lf, 1.0lf);
  point.ior_spread = 0.0lf;
  point.channel_scale = 1.0;
  point.channel = kAllChannels;
  point.unlit = false;
  point.solid = false;
  point.extended = false;
#ifndef PLAIN_MATERIALS
  point.extensions = plain_extensions();
#endif
  return point;
}

// The part of Schlick's Fresnel term that rises from 0 straight on to 1 aslant.
double schlick_rise(double cosine) {
  double m = 1.0lf - clamp(cosine, 0.0lf, 1.0lf);
  return (m * m) * (m * m) * m;
}

double coat_transmittance(ExtensionPoint extensions, dvec3 direction) {
  const double kCoatF0 = 0.04lf;
  if (!(extensions.clearcoat > 0.0lf)) return 1.0lf;
  double rise = schlick_rise(abs(dot(extensions.clearcoat_normal, direction)));
  return 1.0lf - extensions.clearcoat * (kCoatF0 + (1.0lf - kCoatF0) * rise);
}

// What of a surface with this alpha is there.
double coverage_of(Material material, double alpha) {
  if (material.alpha_mode == kMask) return float(alpha) >= material.alpha_cutoff ? 1.0lf : 0.0lf;
  return material.alpha_mode == kBlend ? clamp(alpha, 0.0lf, 1.0lf) : 1.0lf;
}

dvec4 texel_of_material(Materials materials, TextureRef reference, uint encoding, vec2 uv[2]) {
  Textures textures = materials.textures;
  return texel_of(textures, reference, encoding, uv);
}

// Coverage alone.
double evaluate_alpha(Materials materials, uint number, vec2 uv[2], double color_alpha) {
  Material material = materials.all.items[number];
  if (material.alpha_mode == kOpaque) return 1.0lf;
  precise double alpha = double(material.base_color.a) * color_alpha;
  TextureRef reference = material.textures[kBaseColorTexture];
  if (is_present(reference)) {
    precise double textured = alpha * texel_of_material(materials, reference, kSrgb, uv).a;
    alpha = textured;
  }
  return coverage_of(material, alpha);
}

// What a normal map's texel makes of the normal; the unmapped one where the result turns away from the viewer or has no
// direction.
dvec3 mapped_normal(dvec3 texel, double scale, SurfacePoint surface) {
  dvec3 plain = facing_normal(surface);
  if (surface.tangent == dvec3(0.0lf)) return plain;
  dvec3 local = (2.0lf * texel - 1.0lf) * dvec3(scale, scale, 1.0lf);
  dvec3 mapped = local.x * surface.tangent + local.y * surface.bitangent + local.z * surface.shading_normal;
  double size = length(mapped);
  if (!(size > 0.0lf) || !(dot(mapped, surface.to_viewer) > 0.0lf)) return plain;
  return mapped / size;
}

// MaterialPoint::normal alone: as the viewer at surface.to_viewer has it.
dvec3 normal_to_shade_with(Materials materials, SurfacePoint surface) {
  TextureRef reference = materials.all.items[surface.material].textures[kNormalTexture];
  if (!is_present(reference)) return facing_normal(surface);
  double scale = double(materials.all.items[surface.material].normal_scale);
  return mapped_normal(texel_of_material(materials, reference, kLinear, surface.uv).rgb, scale, surface);
}

// ExtensionPoint::clearcoat_normal alone: by the coat's own map.
dvec3 coat_normal_to_shade_with(Materials materials, SurfacePoint surface) {
  int extensions = materials.all.items[surface.material].extensions;
  if (extensions < 0) return facing_normal(surface);
  TextureRef reference = materials.extensions.items[extensions].textures[kClearcoatNormalTexture];
  if (!is_present(reference)) return facing_normal(surface);
  double scale = double(materials.extensions.items[extensions].clearcoat_normal_scale);
  return mapped_normal(texel_of_material(materials, reference, kLinear, surface.uv).rgb, scale, surface);
}

// Whether the surface bends each channel of light otherwise, so that what goes through is to be of one.
bool disperses(MaterialPoint material) {
  return material.ior_spread > 0.0lf && material.channel == kAllChannels;
}

// Whether light is of more than one channel.
bool carries_channels(dvec3 light) {
  return (light.r > 0.0lf ? 1 : 0) + (light.g > 0.0lf ? 1 : 0) + (light.b > 0.0lf ? 1 : 0) > 1;
}

// Leaves the light of one channel to what goes through a surface that disperses, times `scale`.
void set_channel(inout MaterialPoint material, uint channel, double scale) {
  material.channel = channel;
  material.channel_scale = float(scale);
  material.ior = max(material.ior + (double(channel) - 1.0lf) * material.ior_spread, 1.0lf);
}

// Chooses the channel of light that goes through a surface that disperses by what of `throughput` it carries.
void choose_channel(inout MaterialPoint material, dvec3 throughput, double u) {
  double sum = throughput.r + throughput.g + throughput.b;
  if (!(sum > 0.0lf) || !is_finite(sum)) return;
  uint channel = 0u;
  double left = u * sum;
  if (left >= throughput.r) {
    left -= throughput.r;
    channel = left >= throughput.g ? 2u : 1u;
  }
  if (channel == 2u && !(throughput.b > 0.0lf)) channel = 1u;  // where rounding led past the last one with a part
  if (channel == 1u && !(throughput.g > 0.0lf)) channel = 0u;
  set_channel(material, channel, sum / throughput[channel]);
}

// Of unit length, tangent to the surface, rotated and textured as KHR_materials_anisotropy has it.
dvec3 anisotropy_direction(dvec2 rotation, SurfacePoint surface, dvec3 normal, dvec2 texel) {
  dvec2 rotated = dvec2(rotation.x * texel.x - rotation.y * texel.y, rotation.y * texel.x + rotation.x * texel.y);
  dvec3 direction = rotated.x * surface.tangent + rotated.y * surface.bitangent;
  direction -= dot(direction, normal) * normal;
  double size = length(direction);
  if (size > 1e-6lf) return direction / size;
  dvec3 axis = abs(normal.x) < 0.9lf ? dvec3(1.0lf, 0.0lf, 0.0lf) : dvec3(0.0lf, 1.0lf, 0.0lf);
  return normalize(cross(normal, axis));
}

double textured_factor(float factor, double texel) {
  return clamp(double(factor) * texel, 0.0lf, 1.0lf);
}

// A surface's extensions: those of what lies on the material, and of the material itself.
ExtensionPoint read_extensions(Materials materials, int number, SurfacePoint surface, dvec3 normal) {
  dvec4 texels[12];
  for (uint i = 0u; i < kExtensionTextures; ++i) {
    texels[i] = dvec4(1.0lf);
    TextureRef reference = materials.extensions.items[number].textures[i];
    uint encoding = (kSrgbExtensionTextures >> i) & 1u;
    if (is_present(reference)) texels[i] = texel_of_material(materials, reference, encoding, surface.uv);
  }
  MaterialExtensions from = materials.extensions.items[number];
  ExtensionPoint point = plain_extensions();
  point.sheen = materials.sheen;
  point.specular = textured_factor(from.specular, texels[kSpecularTexture].a);
  point.specular_color = dvec3(from.specular_color) * texels[kSpecularColorTexture].rgb;
  point.clearcoat = textured_factor(from.clearcoat, texels[kClearcoatTexture].r);
  if (point.clearcoat > 0.0lf) {
    point.clearcoat_roughness = textured_factor(from.clearcoat_roughness, texels[kClearcoatRoughnessTexture].g);
    point.clearcoat_normal = facing_normal(surface);
    if (is_present(from.textures[kClearcoatNormalTexture])) {
      dvec3 texel = texels[kClearcoatNormalTexture].rgb;
      point.clearcoat_normal = mapped_normal(texel, double(from.clearcoat_normal_scale), surface);
    }
  }
  point.sheen_color = min(dvec3(from.sheen_color) * texels[kSheenColorTexture].rgb, 1.0lf);
  if (point.sheen_color != dvec3(0.0lf)) {
    point.sheen_roughness = textured_factor(from.sheen_roughness, texels[kSheenRoughnessTexture].a);
  }
  point.iridescence = textured_factor(from.iridescence, texels[kIridescenceTexture].r);
  if (point.iridescence > 0.0lf) {
    double between = texels[kIridescenceThicknessTexture].g;
    point.iridescence_ior = double(from.iridescence_ior);
    point.iridescence_nm = double(from.iridescence_min_nm) * (1.0lf - between) + double(from.iridescence_max_nm) * between;
  }
  if (from.anisotropy > 0.0) {
    dvec4 texel = dvec4(1.0lf, 0.5lf, 1.0lf, 1.0lf);
    if (is_present(from.textures[kAnisotropyTexture])) texel = texels[kAnisotropyTexture];
    point.anisotropy = textured_factor(from.anisotropy, texel.b);
    point.anisotropy_direction = anisotropy_direction(from.anisotropy_rotation, surface, normal, 2.0lf * texel.rg - 1.0lf);
  }
  point.diffuse_transmission = textured_factor(from.diffuse_transmission, texels[kDiffuseTransmissionTexture].a);
  if (point.diffuse_transmission > 0.0lf) {
    point.diffuse_transmission_color =
        min(dvec3(from.diffuse_transmission_color) * texels[kDiffuseTransmissionColorTexture].rgb, 1.0lf);
  }
  return point;
}

bool has_effect(ExtensionPoint point) {
  return point.specular != 1.0lf || point.specular_color != dvec3(1.0lf) || point.clearcoat > 0.0lf ||
         point.sheen_color != dvec3(0.0lf) || point.anisotropy > 0.0lf || point.iridescence > 0.0lf ||
         point.diffuse_transmission > 0.0lf;
}

#ifndef PLAIN_MATERIALS
void add_extensions(Materials materials, Material material, SurfacePoint surface, inout MaterialPoint point) {
  const double kHalfOfTwentieth = 0.025lf;
  if (material.thickness > 0.0 && point.ior > 1.0lf) {
    double dispersion = double(materials.extensions.items[material.extensions].dispersion);
    point.ior_spread = kHalfOfTwentieth * dispersion * (point.ior - 1.0lf);
  }
  ExtensionPoint read = read_extensions(materials, material.extensions, surface, point.normal);
  if (!has_effect(read)) return;
  point.extended = true;
  point.extensions = read;
  bool is_volume = material.thickness > 0.0 && (material.transmission > 0.0 || read.diffuse_transmission > 0.0lf);
  if (!(is_volume && surface.inside)) point.emission *= coat_transmittance(read, surface.to_viewer);
  if (!(read.diffuse_transmission > 0.0lf) || !(material.thickness > 0.0)) return;
  point.solid = true;
  point.absorption = material.absorption;
}
#endif

// The material with its textures read at the surface's coordinates, vertex colours and normal map applied.
MaterialPoint evaluate_material(Materials materials, SurfacePoint surface) {
  Material material = materials.all.items[surface.material];
  dvec4 texels[6];
  for (uint i = 0u; i < kMaterialTextures; ++i) {
    texels[i] = dvec4(1.0lf);
    TextureRef reference = materials.all.items[surface.material].textures[i];
    uint encoding = (kSrgbMaterialTextures >> i) & 1u;
    if (is_present(reference)) texels[i] = texel_of_material(materials, reference, encoding, surface.uv);
  }
  MaterialPoint point = plain_material();
  precise dvec4 base = dvec4(material.base_color) * surface.color;
  precise dvec4 textured = base * texels[kBaseColorTexture];
  point.base_color = clamp(textured.rgb, 0.0lf, 1.0lf);
  point.alpha = coverage_of(material, textured.a);
  point.normal = facing_normal(surface);
  if (is_present(material.textures[kNormalTexture])) {
    point.normal = mapped_normal(texels[kNormalTexture].rgb, double(material.normal_scale), surface);
  }
  if (material.unlit != 0u) {
    point.unlit = true;
    point.emission = point.base_color;
    return point;
  }
  point.metallic = textured_factor(material.metallic, texels[kMetallicRoughnessTexture].b);
  point.roughness = textured_factor(material.roughness, texels[kMetallicRoughnessTexture].g);
  point.ior = double(material.ior);
  point.emission = dvec3(material.emissive) * texels[kEmissiveTexture].rgb;
  if (is_present(material.textures[kOcclusionTexture])) {
    point.occlusion = 1.0lf + double(material.occlusion_strength) * (texels[kOcclusionTexture].r - 1.0lf);
  }
  // What is not there for who looks from behind sends no light there either.
  if (surface.inside && material.shows_both_sides == 0u) point.emission = dvec3(0.0lf);
#ifndef PLAIN_MATERIALS
  if (material.extensions >= 0) add_extensions(materials, material, surface, point);
#endif
  if (!(material.transmission > 0.0)) return point;
  point.transmission = textured_factor(material.transmission, texels[kTransmissionTexture].r);
  point.solid = material.thickness > 0.0;
  if (point.solid) point.absorption = material.absorption;
  return point;
}
