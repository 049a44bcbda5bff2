#include "scene/requirements.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <numbers>

#include "scene/studio.h"

namespace hpr {
namespace {

/// Whether all that is placed so has no area.
bool flattens(const glm::dmat4& to_world) {
  const glm::dmat3 linear(to_world);
  for (int i = 0; i < 3; ++i) {
    if (glm::cross(linear[i], linear[(i + 1) % 3]) != glm::dvec3(0.0)) return false;
  }
  return true;
}

/// Whether nothing of a surface is there: textures and vertices make alpha no larger.
bool covers_nothing(const Material& material) {
  return (material.alpha_mode == AlphaMode::Mask && material.base_color.a < material.alpha_cutoff) ||
         (material.alpha_mode == AlphaMode::Blend && !(material.base_color.a > 0.0F));
}

/// Which materials a triangle of the scene really shows.
std::vector<const Material*> visible_materials(const Scene& scene) {
  std::vector<std::uint8_t> used(scene.materials.size(), 0);
  for (const Instance& instance : scene.instances) {
    const Mesh& mesh = scene.mesh_of(instance);
    if (mesh.triangle_count() > 0 && !flattens(instance.to_world)) used[mesh.material] = 1;
  }
  std::vector<const Material*> materials;
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (used[i] != 0 && !covers_nothing(scene.materials[i])) materials.push_back(&scene.materials[i]);
  }
  return materials;
}

const MaterialExtensions& extensions_of(const Material& material) {
  static const MaterialExtensions none;
  return material.extensions ? *material.extensions : none;
}

/// The least texel of one channel of a texture, 1 without: filtering never goes below it.
float least_texel(const Scene& scene, const TextureRef& reference, std::uint8_t Rgba8::*channel) {
  if (!reference.present()) return 1.0F;
  return static_cast<float>(scene.textures[static_cast<std::size_t>(reference.texture)].image.facts().least.*channel) /
         255.0F;
}

/// The least a material can reach anywhere, its coat included.
float min_roughness(const Scene& scene, const Material& material) {
  const float base = material.roughness * least_texel(scene, material.metallic_roughness_texture, &Rgba8::g);
  const MaterialExtensions& extensions = extensions_of(material);
  if (!(extensions.clearcoat > 0.0F)) return base;
  return std::min(
      base, extensions.clearcoat_roughness * least_texel(scene, extensions.clearcoat_roughness_texture, &Rgba8::g));
}

/// The most it can reach.
float max_roughness(const Material& material) {
  const MaterialExtensions& extensions = extensions_of(material);
  return extensions.clearcoat > 0.0F ? std::max(material.roughness, extensions.clearcoat_roughness)
                                     : material.roughness;
}

float min_metallic(const Scene& scene, const Material& material) {
  return material.metallic * least_texel(scene, material.metallic_roughness_texture, &Rgba8::b);
}

bool transmits_somewhere(const Scene& scene, const Material& material) {
  if (!(material.transmission > 0.0F)) return false;
  if (!material.transmission_texture.present()) return true;
  const Texels& texels = scene.textures[static_cast<std::size_t>(material.transmission_texture.texture)].image;
  return texels.size().area() == 0 || texels.facts().largest.r > 0;
}

bool shines(const std::optional<Environment>& environment) {
  return environment && environment->scale > 0.0 &&
         std::ranges::any_of(environment->image.pixels(),
                             [](const Rgb& color) { return color.r > 0.0F || color.g > 0.0F || color.b > 0.0F; });
}

double luminance(const Rgb& color) {
  return 0.2126 * color.r + 0.7152 * color.g + 0.0722 * color.b;
}

/// Whether no direction is much brighter than the mean of all: rays in any direction then find its light.
bool has_no_bright_spots(const Environment& environment) {
  constexpr double kMaxOverMean = 8.0;
  const Size size = environment.image.size();
  double sum = 0.0;
  double weights = 0.0;
  double brightest = 0.0;
  for (int y = 0; y < size.height; ++y) {
    const double weight = std::sin(std::numbers::pi * (y + 0.5) / size.height);
    for (int x = 0; x < size.width; ++x) {
      const double value = luminance(environment.image.at(x, y));
      sum += weight * value;
      brightest = std::max(brightest, value);
    }
    weights += weight * size.width;
  }
  return brightest * weights <= kMaxOverMean * sum;
}

/// Of a scene with so many lights, emitting materials and environments.
bool is_lit_evenly(const Scene& scene, std::size_t lights) {
  return scene.lights.empty() && shines(scene.environment) && has_no_bright_spots(*scene.environment) &&
         (lights == 1 || emitted_radiance(scene) < kLitRadiance);
}

std::string counted(std::size_t count, const char* one, const char* many) {
  return count == 1 ? fmt::format("1 {}", one) : fmt::format("{} {}", count, many);
}

bool is_black(const Material& material) {
  return material.base_color.r <= 0.0F && material.base_color.g <= 0.0F && material.base_color.b <= 0.0F;
}

/// Whether some of a material is no metal, and takes in light that it may give back.
bool takes_in(const Scene& scene, const Material& material) {
  return !material.unlit && !is_black(material) && min_metallic(scene, material) < 1.0F;
}

bool has_sheen(const Material& material) {
  return !material.unlit && extensions_of(material).sheen_color != glm::vec3(0.0F);
}

/// Whether it has a diffuse part.
bool is_diffuse(const Scene& scene, const Material& material) {
  if (has_sheen(material)) return true;
  return takes_in(scene, material) && (material.transmission < 1.0F || material.transmission_texture.present());
}

/// Whether it has a specular part: a metal reflects its colour, at grazing angles all colours; a dielectric those by
/// its index alone.
bool reflects(const Scene& scene, const Material& material) {
  if (material.unlit) return false;
  const MaterialExtensions& extensions = extensions_of(material);
  if (material.metallic > 0.0F || extensions.clearcoat > 0.0F || extensions.iridescence > 0.0F) return true;
  return min_metallic(scene, material) < 1.0F && material.ior != 1.0F && extensions.specular > 0.0F;
}

/// Whether it is diffuse, or has a specular part too rough to be followed.
bool scatters(const Scene& scene, const Material& material) {
  return is_diffuse(scene, material) || (reflects(scene, material) && max_roughness(material) >= kMirrorRoughness);
}

bool mirrors(const Scene& scene, const Material& material) {
  return reflects(scene, material) && min_roughness(scene, material) < kMirrorRoughness;
}

/// An index of 0 stands for a wall that reflects all.
bool transmits(const Scene& scene, const Material& material) {
  const MaterialExtensions& extensions = extensions_of(material);
  if (!material.unlit && extensions.diffuse_transmission > 0.0F &&
      extensions.diffuse_transmission_color != glm::vec3(0.0F) && min_metallic(scene, material) < 1.0F) {
    return true;
  }
  return takes_in(scene, material) && transmits_somewhere(scene, material) && material.ior > 0.0F;
}

bool casts_shadows(const Light& light) {
  return light.type != LightType::Headlight &&
         std::max({light.intensity.r, light.intensity.g, light.intensity.b}) > 0.0F;
}

/// Lights that cast shadows: all but headlights; an emitting material is one, and so is the environment.
std::size_t count_lights(const Scene& scene, const std::vector<const Material*>& materials) {
  const auto punctual = std::ranges::count_if(scene.lights, casts_shadows);
  const auto emitting =
      std::ranges::count_if(materials, [&](const Material* material) { return emits(scene, *material); });
  return static_cast<std::size_t>(punctual + emitting) + (shines(scene.environment) ? 1 : 0);
}

}  // namespace

bool emits(const Scene& scene, const Material& material) {
  if (material.unlit) return false;  // shows its colour and lights nothing
  if (!(std::max({material.emissive.r, material.emissive.g, material.emissive.b}) > 0.0F)) return false;
  if (!material.emissive_texture.present()) return true;
  const Texels& texels = scene.textures[static_cast<std::size_t>(material.emissive_texture.texture)].image;
  const Rgba8 largest = texels.facts().largest;
  return texels.size().area() == 0 || (material.emissive.r > 0.0F && largest.r > 0) ||
         (material.emissive.g > 0.0F && largest.g > 0) || (material.emissive.b > 0.0F && largest.b > 0);
}

bool gives_light(const Scene& scene) {
  if (!scene.lights.empty() || (scene.environment && scene.environment->scale > 0.0)) return true;
  return std::ranges::any_of(visible_materials(scene),
                             [&](const Material* material) { return emits(scene, *material); });
}

Requirements requirements_of(const Scene& scene) {
  const std::vector<const Material*> materials = visible_materials(scene);
  const std::size_t lights = count_lights(scene, materials);
  const auto count = [&](const auto& is) {
    return static_cast<std::size_t>(
        std::ranges::count_if(materials, [&](const Material* material) { return is(scene, *material); }));
  };
  const std::size_t smooth = count(mirrors);
  const std::size_t clear = count(transmits);
  const std::size_t rough = count(scatters);
  const std::size_t diffuse = count(is_diffuse);
  const std::size_t lit =
      materials.size() - count([](const Scene&, const Material& material) { return material.unlit; });

  Requirements needs;
  if (materials.empty()) {
    const Requirement nothing{false, "no triangle of the scene can be seen"};
    return {nothing, nothing, nothing, nothing, nothing, nothing};
  }
  needs.shadow = lights == 0 ? Requirement{false, "no light casts shadows"}
                 : lit == 0  ? Requirement{false, "no material takes light"}
                             : Requirement{true, counted(lights, "light casts shadows", "lights cast shadows")};
  needs.reflection = smooth > 0 ? Requirement{true, counted(smooth, "material mirrors", "materials mirror")}
                                : Requirement{false, "no material is smooth enough to mirror"};
  needs.refraction = clear > 0
                         ? Requirement{true, counted(clear, "material transmits light", "materials transmit light")}
                         : Requirement{false, "no material transmits light"};
  const bool bundled = lights > 0 && smooth + clear > 0;
  needs.photon = !bundled ? Requirement{false, "no light can be bundled into caustics"}
                 : rough == 0
                     ? Requirement{false, "no material is matte or rough enough to show caustics"}
                     : Requirement{true, "lights reach smooth or clear materials, which bundle it into caustics"};
  for (const Material* material : materials) {
    if (!reflects(scene, *material)) continue;
    needs.min_roughness = std::min(needs.min_roughness, min_roughness(scene, *material));
    needs.max_roughness = std::max(needs.max_roughness, max_roughness(*material));
  }
  needs.constant_environment = lights == 1 && shines(scene.environment) && scene.environment->is_constant();
  needs.even_environment = needs.constant_environment || is_lit_evenly(scene, lights);
  needs.indirect = lights > 0 && rough > 0 ? Requirement{true, "surfaces scatter light on to others"}
                   : lights > 0            ? Requirement{false, "no material scatters light"}
                                           : Requirement{false, "no light that surfaces could scatter"};
  needs.ambient_occlusion =
      diffuse > 0
          ? Requirement{true, counted(diffuse, "material scatters ambient light", "materials scatter ambient light")}
          : Requirement{false, "no material is matte"};
  return needs;
}

}  // namespace hpr
