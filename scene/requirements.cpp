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

std::string counted(std::size_t count, const char* one, const char* many) {
  return count == 1 ? fmt::format("1 {}", one) : fmt::format("{} {}", count, many);
}

}  // namespace

Requirements requirements_of(const Scene& scene) {
  const std::vector<const Material*> materials = visible_materials(scene);
  const auto lights = static_cast<std::size_t>(
      std::ranges::count_if(scene.lights, [](const Light& light) { return light.type != LightType::Headlight; }));
  const auto smooth = static_cast<std::size_t>(std::ranges::count_if(
      materials, [&](const Material* material) { return least_roughness(scene, *material) < kMirrorRoughness; }));
  const auto clear = static_cast<std::size_t>(
      std::ranges::count_if(materials, [](const Material* material) { return material->transmission > 0.0F; }));

  Requirements needs;
  if (materials.empty()) {
    const Requirement nothing{false, "the scene has no triangles"};
    return {nothing, nothing, nothing, nothing};
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
  return needs;
}

}  // namespace hpr
