#include "gpu/light/gpu_materials.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <span>
#include <vector>

#include "rt/materials/material_point.h"
#include "rt/materials/sheen.h"

namespace hpr {
namespace {

/// As in materials.glsl.
struct GpuMaterial {
  glm::dvec3 absorption{0.0};
  std::array<TextureRef, 6> textures{};
  glm::vec4 base_color{1.0F};
  glm::vec3 emissive{0.0F};
  float metallic = 0.0F;
  float roughness = 0.0F;
  float normal_scale = 0.0F;
  float occlusion_strength = 0.0F;
  float transmission = 0.0F;
  float ior = 0.0F;
  float thickness = 0.0F;
  float alpha_cutoff = 0.0F;
  std::uint32_t alpha_mode = 0;
  std::uint32_t shows_both_sides = 0;
  std::uint32_t unlit = 0;
  std::int32_t extensions = -1;
  std::uint32_t padding = 0;
};
static_assert(sizeof(GpuMaterial) == 296);

/// As MaterialExtensions in materials.glsl.
struct GpuExtensions {
  glm::dvec2 anisotropy_rotation{1.0, 0.0};
  std::array<TextureRef, 12> textures{};
  glm::vec3 specular_color{0.0F};
  glm::vec3 sheen_color{0.0F};
  glm::vec3 diffuse_transmission_color{0.0F};
  float specular = 0.0F;
  float clearcoat = 0.0F;
  float clearcoat_roughness = 0.0F;
  float clearcoat_normal_scale = 0.0F;
  float sheen_roughness = 0.0F;
  float anisotropy = 0.0F;
  float iridescence = 0.0F;
  float iridescence_ior = 0.0F;
  float iridescence_min_nm = 0.0F;
  float iridescence_max_nm = 0.0F;
  float dispersion = 0.0F;
  float diffuse_transmission = 0.0F;
  std::uint32_t padding = 0;
};
static_assert(sizeof(GpuExtensions) == 488);

GpuMaterial converted(const Material& material) {
  GpuMaterial made;
  made.absorption = absorption_of(material);
  made.textures = {material.base_color_texture, material.metallic_roughness_texture, material.normal_texture,
                   material.emissive_texture,   material.occlusion_texture,          material.transmission_texture};
  made.base_color = material.base_color;
  made.emissive = material.emissive;
  made.metallic = material.metallic;
  made.roughness = material.roughness;
  made.normal_scale = material.normal_scale;
  made.occlusion_strength = material.occlusion_strength;
  made.transmission = material.transmission;
  made.ior = material.ior;
  made.thickness = material.thickness;
  made.alpha_cutoff = material.alpha_cutoff;
  made.alpha_mode = static_cast<std::uint32_t>(material.alpha_mode);
  made.shows_both_sides = shows_both_sides(material) ? 1 : 0;
  made.unlit = material.unlit ? 1 : 0;
  return made;
}

GpuExtensions converted(const MaterialExtensions& from) {
  GpuExtensions made;
  const double angle = from.anisotropy_rotation_radians;
  made.anisotropy_rotation = {std::cos(angle), std::sin(angle)};
  std::ranges::transform(from.textures(), made.textures.begin(), [](const TextureRef* each) { return *each; });
  made.specular_color = from.specular_color;
  made.sheen_color = from.sheen_color;
  made.diffuse_transmission_color = from.diffuse_transmission_color;
  made.specular = from.specular;
  made.clearcoat = from.clearcoat;
  made.clearcoat_roughness = from.clearcoat_roughness;
  made.clearcoat_normal_scale = from.clearcoat_normal_scale;
  made.sheen_roughness = from.sheen_roughness;
  made.anisotropy = from.anisotropy;
  made.iridescence = from.iridescence;
  made.iridescence_ior = from.iridescence_ior;
  made.iridescence_min_nm = from.iridescence_min_nm;
  made.iridescence_max_nm = from.iridescence_max_nm;
  made.dispersion = from.dispersion;
  made.diffuse_transmission = from.diffuse_transmission;
  return made;
}

}  // namespace

GpuMaterials::GpuMaterials(const GpuDevice& device, const Scene& scene)
    : textures_(device, scene.textures), tables_(device) {
  std::vector<GpuMaterial> materials;
  std::vector<GpuExtensions> extensions;
  for (const Material& material : scene.materials) {
    GpuMaterial& made = materials.emplace_back(converted(material));
    if (!material.extensions) continue;
    made.extensions = static_cast<std::int32_t>(extensions.size());
    extensions.push_back(converted(*material.extensions));
  }
  const bool has_sheen =
      std::ranges::any_of(extensions, [](const GpuExtensions& each) { return each.sheen_color != glm::vec3(0.0F); });
  address_ = tables_.upload_one(std::array{textures_.address(), tables_.upload(materials), tables_.upload(extensions),
                                           has_sheen ? tables_.upload(sheen_albedo_table()) : 0});
}

}  // namespace hpr
