#include "rt/brdf.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "rt/texture.h"

namespace hpr {
namespace {

double schlick_weight(double cosine) {
  const double m = 1.0 - std::clamp(cosine, 0.0, 1.0);
  const double m2 = m * m;
  return m2 * m2 * m;
}

glm::dvec4 sample(const Scene& scene, const TextureRef& reference, Encoding encoding,
                  const std::array<glm::vec2, 2>& uv) {
  if (!reference.present()) return glm::dvec4(1.0);
  const glm::vec2& set = uv[std::min<std::size_t>(reference.uv_set, uv.size() - 1)];
  return sample_texture(scene.textures[static_cast<std::size_t>(reference.texture)], encoding,
                        transformed_uv(reference, set));
}

}  // namespace

glm::dvec3 Brdf::fresnel(double cosine) const {
  const glm::dvec3 f0 = dielectric_f0 * (1.0 - metallic) + base_color * metallic;
  return f0 + (glm::dvec3(1.0) - f0) * schlick_weight(cosine);
}

glm::dvec3 Brdf::value(const glm::dvec3& normal, const glm::dvec3& to_light, const glm::dvec3& to_viewer) const {
  const double nl = glm::dot(normal, to_light);
  const double nv = glm::dot(normal, to_viewer);
  if (!(nl > 0.0) || !(nv > 0.0)) return glm::dvec3(0.0);
  const glm::dvec3 sum = to_light + to_viewer;
  // Both directions lie on the normal's side, so their sum cannot vanish.
  const glm::dvec3 half = glm::normalize(sum);
  const double vh = glm::dot(to_viewer, half);
  const double dielectric_fresnel = dielectric_f0 + (1.0 - dielectric_f0) * schlick_weight(vh);
  const double diffuse = (1.0 - metallic) * (1.0 - transmission) * (1.0 - dielectric_fresnel) / std::numbers::pi;
  glm::dvec3 result = diffuse * base_color;
  if (is_delta()) return result;

  const double alpha = roughness * roughness;
  const double alpha2 = alpha * alpha;
  // (n.h)^2 (alpha^2 - 1) + 1 without the cancellation that costs all digits of a narrow lobe.
  const glm::dvec3 across = glm::cross(normal, half);
  const double nh = glm::dot(normal, half);
  const double spread = glm::dot(across, across) + alpha2 * nh * nh;
  const double distribution = alpha2 / (std::numbers::pi * spread * spread);
  const double visibility =
      0.5 / (nl * std::sqrt(alpha2 + (1.0 - alpha2) * nv * nv) + nv * std::sqrt(alpha2 + (1.0 - alpha2) * nl * nl));
  result += fresnel(vh) * (distribution * visibility);
  return result;
}

MaterialPoint evaluate_material(const Scene& scene, const Material& material, const std::array<glm::vec2, 2>& uv) {
  MaterialPoint point;
  const glm::dvec4 base = sample(scene, material.base_color_texture, Encoding::Srgb, uv);
  const glm::dvec4 rough_metal = sample(scene, material.metallic_roughness_texture, Encoding::Linear, uv);
  point.brdf.base_color = glm::clamp(glm::dvec3(material.base_color) * glm::dvec3(base), 0.0, 1.0);
  point.brdf.metallic = std::clamp(material.metallic * rough_metal.b, 0.0, 1.0);
  point.brdf.roughness = std::clamp(material.roughness * rough_metal.g, 0.0, 1.0);
  point.brdf.transmission = std::clamp<double>(material.transmission, 0.0, 1.0);
  const double ior = material.ior;
  // The extension reserves 0 for "reflects everything".
  const double ratio = ior > 0.0 ? (1.0 - ior) / (1.0 + ior) : 1.0;
  point.brdf.dielectric_f0 = ratio * ratio;
  point.emission = glm::dvec3(material.emissive);
  if (material.emissive_texture.present()) {
    point.emission *= glm::dvec3(sample(scene, material.emissive_texture, Encoding::Srgb, uv));
  }
  return point;
}

}  // namespace hpr
