// Surface points as tests hand them over.
// Needs surface_point.glsl and materials.glsl.

struct PlainSurface {
  dvec3 to_viewer;
  dvec3 geometric_normal;
  dvec3 shading_normal;
  dvec3 tangent;
  dvec3 bitangent;
  dvec4 color;
  vec2 uv[2];
  uint material;
  uint inside;
};

SurfacePoint surface_of(PlainSurface plain) {
  SurfacePoint point;
  point.position = dvec3(0.0lf);
  point.to_viewer = plain.to_viewer;
  point.geometric_normal = plain.geometric_normal;
  point.shading_normal = plain.shading_normal;
  point.lift = dvec3(0.0lf);
  point.offset = 0.0lf;
  point.color = plain.color;
  point.tangent = plain.tangent;
  point.bitangent = plain.bitangent;
  point.uv = plain.uv;
  point.surface = 0u;
  point.material = plain.material;
  point.layer = 0u;
  point.inside = plain.inside != 0u;
  return point;
}

// Material points, likewise.
struct PlainExtensions {
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
};
struct PlainPoint {
  dvec3 base_color;
  double metallic;
  double roughness;
  double transmission;
  double ior;
  dvec3 normal;
  double ior_spread;
  float channel_scale;
  uint channel;
  uint unlit;
  uint solid;
  uint extended;
  uint padding;
  PlainExtensions extensions;
};

MaterialPoint material_of(Materials materials, PlainPoint plain) {
  MaterialPoint point = plain_material();
  point.base_color = plain.base_color;
  point.metallic = plain.metallic;
  point.roughness = plain.roughness;
  point.transmission = plain.transmission;
  point.ior = plain.ior;
  point.normal = plain.normal;
  point.ior_spread = plain.ior_spread;
  point.channel_scale = plain.channel_scale;
  point.channel = plain.channel;
  point.unlit = plain.unlit != 0u;
  point.solid = plain.solid != 0u;
  point.extended = plain.extended != 0u;
  point.extensions.sheen = materials.sheen;
  point.extensions.specular = plain.extensions.specular;
  point.extensions.specular_color = plain.extensions.specular_color;
  point.extensions.clearcoat = plain.extensions.clearcoat;
  point.extensions.clearcoat_roughness = plain.extensions.clearcoat_roughness;
  point.extensions.clearcoat_normal = plain.extensions.clearcoat_normal;
  point.extensions.sheen_color = plain.extensions.sheen_color;
  point.extensions.sheen_roughness = plain.extensions.sheen_roughness;
  point.extensions.anisotropy = plain.extensions.anisotropy;
  point.extensions.anisotropy_direction = plain.extensions.anisotropy_direction;
  point.extensions.iridescence = plain.extensions.iridescence;
  point.extensions.iridescence_ior = plain.extensions.iridescence_ior;
  point.extensions.iridescence_nm = plain.extensions.iridescence_nm;
  point.extensions.diffuse_transmission = plain.extensions.diffuse_transmission;
  point.extensions.diffuse_transmission_color = plain.extensions.diffuse_transmission_color;
  return point;
}
