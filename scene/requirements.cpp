#include "scene/requirements.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>

namespace hpr {
namespace {

/// Which materials a triangle of the scene really shows.
std::vector<const Material*> visible_materials(const Scene& scene) {
  std::vector<std::uint8_t> used(scene.materials.size(), 0);
  for (const Instance& instance : scene.instances) {
    const Mesh& mesh = scene.mesh_of(instance);
    if (!mesh.triangles.empty()) used[mesh.material] = 1;
  }
  std::vector<const Material*> materials;
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (used[i] != 0) materials.push_back(&scene.materials[i]);
  }
  return materials;
}

/// The least roughness a material can reach anywhere: filtering never goes below the least texel.
float least_roughness(const Scene& scene, const Material& material) {
  if (!material.metallic_roughness_texture.present()) return material.roughness;
  const auto texture = static_cast<std::size_t>(material.metallic_roughness_texture.texture);
  const auto pixels = scene.textures[texture].image.pixels();
  if (pixels.empty()) return material.roughness;
  const auto least = std::ranges::min_element(pixels, {}, &Rgba8::g);
  return material.roughness * (static_cast<float>(least->g) / 255.0F);
}

bool shines(const std::optional<Environment>& environment) {
  return environment && environment->scale > 0.0 &&
         std::ranges::any_of(environment->image.pixels(),
                             [](const Rgb& color) { return color.r > 0.0F || color.g > 0.0F || color.b > 0.0F; });
}

std::string counted(std::size_t count, const char* one, const char* many) {
  return count == 1 ? fmt::format("1 {}", one) : fmt::format("{} {}", count, many);
}

/// Whether a material has a diffuse part, or a specular one too rough to be followed.
bool scatters(const Material* material) {
  const bool black = material->base_color.r <= 0.0F && material->base_color.g <= 0.0F && material->base_color.b <= 0.0F;
  return !material->unlit && !black && (material->metallic < 1.0F || material->roughness >= kMirrorRoughness);
}

/// Lights that cast shadows: all but headlights; an emitting material is one, and so is the environment.
std::size_t count_lights(const Scene& scene, const std::vector<const Material*>& materials) {
  const auto punctual =
      std::ranges::count_if(scene.lights, [](const Light& light) { return light.type != LightType::Headlight; });
  const auto emitting =
      std::ranges::count_if(materials, [&](const Material* material) { return emits(scene, *material); });
  return static_cast<std::size_t>(punctual + emitting) + (shines(scene.environment) ? 1 : 0);
}

}  // namespace

bool emits(const Scene& scene, const Material& material) {
  if (material.unlit) return false;  // shows its colour and lights nothing
  if (!(std::max({material.emissive.r, material.emissive.g, material.emissive.b}) > 0.0F)) return false;
  if (!material.emissive_texture.present()) return true;
  const auto pixels = scene.textures[static_cast<std::size_t>(material.emissive_texture.texture)].image.pixels();
  return pixels.empty() || std::ranges::any_of(pixels, [&](const Rgba8& texel) {
           return (material.emissive.r > 0.0F && texel.r > 0) || (material.emissive.g > 0.0F && texel.g > 0) ||
                  (material.emissive.b > 0.0F && texel.b > 0);
         });
}

bool gives_light(const Scene& scene) {
  if (!scene.lights.empty() || shines(scene.environment)) return true;
  return std::ranges::any_of(visible_materials(scene),
                             [&](const Material* material) { return emits(scene, *material); });
}

Requirements requirements_of(const Scene& scene) {
  const std::vector<const Material*> materials = visible_materials(scene);
  const std::size_t lights = count_lights(scene, materials);
  const auto smooth = static_cast<std::size_t>(std::ranges::count_if(
      materials, [&](const Material* material) { return least_roughness(scene, *material) < kMirrorRoughness; }));
  const auto clear = static_cast<std::size_t>(
      std::ranges::count_if(materials, [](const Material* material) { return material->transmission > 0.0F; }));

  Requirements needs;
  if (materials.empty()) {
    const Requirement nothing{false, "the scene has no triangles"};
    return {nothing, nothing, nothing, nothing, nothing, nothing, 1.0F};
  }
  needs.shadow = lights > 0 ? Requirement{true, counted(lights, "light casts shadows", "lights cast shadows")}
                            : Requirement{false, "no light casts shadows"};
  needs.reflection = smooth > 0 ? Requirement{true, counted(smooth, "material mirrors", "materials mirror")}
                                : Requirement{false, "no material is smooth enough to mirror"};
  needs.refraction = clear > 0
                         ? Requirement{true, counted(clear, "material transmits light", "materials transmit light")}
                         : Requirement{false, "no material transmits light"};
  needs.photon = lights > 0 && smooth + clear > 0
                     ? Requirement{true, "lights reach smooth or clear materials, which bundle it into caustics"}
                     : Requirement{false, "no light can be bundled into caustics"};
  const auto rough = static_cast<std::size_t>(std::ranges::count_if(materials, scatters));
  for (const Material* material : materials) {
    needs.least_roughness = std::min(needs.least_roughness, least_roughness(scene, *material));
  }
  needs.indirect = lights > 0 && rough > 0 ? Requirement{true, "surfaces scatter light on to others"}
                   : lights > 0            ? Requirement{false, "no material scatters light"}
                                           : Requirement{false, "no light that surfaces could scatter"};
  needs.ambient_occlusion =
      rough > 0
          ? Requirement{true, counted(rough, "material scatters ambient light", "materials scatter ambient light")}
          : Requirement{false, "no material scatters light"};
  return needs;
}

}  // namespace hpr
