#include "rt/materials/material_point.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace hpr {
namespace {

/// A coordinate brought into [0, 1] by the wrap mode, before it is scaled to texels: huge values lose nothing more.
double wrapped(double coordinate, Wrap wrap) {
  if (wrap == Wrap::Repeat && std::abs(coordinate) < 0x1p31) {
    const double left = coordinate - static_cast<double>(static_cast<std::int64_t>(coordinate));
    return left < 0.0 ? left + 1.0 : left;
  }
  if (!std::isfinite(coordinate)) return 0.0;
  switch (wrap) {
    case Wrap::ClampToEdge:
      return std::clamp(coordinate, 0.0, 1.0);
    case Wrap::MirroredRepeat: {
      const double in_period = coordinate - 2.0 * std::floor(0.5 * coordinate);
      return in_period > 1.0 ? 2.0 - in_period : in_period;
    }
    case Wrap::Repeat:
      break;
  }
  return coordinate - std::floor(coordinate);
}

/// The texel that stands at `index`, at most one beyond an edge.
int texel_index(int index, int count, Wrap wrap) {
  if (index < 0) return wrap == Wrap::Repeat ? count - 1 : 0;
  if (index >= count) return wrap == Wrap::Repeat ? 0 : count - 1;
  return index;
}

glm::dvec4 decoded(Rgba8 texel, Encoding encoding) {
  constexpr double kLevel = 1.0 / 255.0;
  if (encoding == Encoding::Srgb) {
    return {srgb_to_linear(texel.r), srgb_to_linear(texel.g), srgb_to_linear(texel.b), texel.a * kLevel};
  }
  return glm::dvec4(texel.r, texel.g, texel.b, texel.a) * kLevel;
}

}  // namespace

glm::dvec4 sample_texture(const Texture& texture, Encoding encoding, glm::dvec2 uv) {
  const Size size = texture.image.size();
  if (size.area() == 0) return glm::dvec4(1.0);
  texture.image.require();
  const double s = wrapped(uv.x, texture.wrap_s) * size.width;
  const double t = wrapped(uv.y, texture.wrap_t) * size.height;
  if (texture.nearest) {
    const int column = texel_index(static_cast<int>(s), size.width, texture.wrap_s);
    return decoded(texture.image.at(column, texel_index(static_cast<int>(t), size.height, texture.wrap_t)), encoding);
  }
  const double x = s - 0.5;
  const double y = t - 0.5;
  const int x0 = x < 0.0 ? -1 : static_cast<int>(x);
  const int y0 = y < 0.0 ? -1 : static_cast<int>(y);
  const double fx = x - x0;
  const double fy = y - y0;
  const int left = texel_index(x0, size.width, texture.wrap_s);
  const int right = texel_index(x0 + 1, size.width, texture.wrap_s);
  const int above = texel_index(y0, size.height, texture.wrap_t);
  const int below = texel_index(y0 + 1, size.height, texture.wrap_t);
  const std::array<Rgba8, 4> texels{texture.image.at(left, above), texture.image.at(right, above),
                                    texture.image.at(left, below), texture.image.at(right, below)};
  // Much of most textures is even.
  if (texels[0] == texels[1] && texels[0] == texels[2] && texels[0] == texels[3]) return decoded(texels[0], encoding);
  const glm::dvec4 upper = decoded(texels[0], encoding) * (1.0 - fx) + decoded(texels[1], encoding) * fx;
  const glm::dvec4 lower = decoded(texels[2], encoding) * (1.0 - fx) + decoded(texels[3], encoding) * fx;
  return upper * (1.0 - fy) + lower * fy;
}

void prefetch_texture(const Texture& texture, glm::dvec2 uv) {
  const Size size = texture.image.size();
  if (size.area() == 0 || !texture.image.is_here()) return;
  const int x = std::min(static_cast<int>(wrapped(uv.x, texture.wrap_s) * size.width), size.width - 1);
  const double t = wrapped(uv.y, texture.wrap_t) * size.height;
  // Its neighbours in the row mostly lie in the same line of the cache.
  for (const double row : {t - 0.5, t + 0.5}) {
    __builtin_prefetch(&texture.image.at(x, std::clamp(static_cast<int>(row), 0, size.height - 1)));
  }
}

glm::dvec2 transformed_uv(const TextureRef& reference, const glm::vec2& uv) {
  const auto& m = reference.transform;
  const double u = uv.x;
  const double v = uv.y;
  return {m[0] * u + m[2] * v + m[4], m[1] * u + m[3] * v + m[5]};
}

namespace {

glm::dvec4 texel_of(const Scene& scene, const TextureRef& reference, Encoding encoding,
                    const std::array<glm::vec2, 2>& uv) {
  const glm::vec2& set = uv[std::min<std::size_t>(reference.uv_set, uv.size() - 1)];
  return sample_texture(scene.textures[static_cast<std::size_t>(reference.texture)], encoding,
                        transformed_uv(reference, set));
}

/// What a normal map of tangent space makes of the normal; the unmapped one where the result turns away from the viewer
/// or has no direction.
glm::dvec3 mapped_normal(const Scene& scene, const TextureRef& map, double scale, const SurfacePoint& surface) {
  const glm::dvec3& plain = surface.facing_normal();
  if (surface.tangent == glm::dvec3(0.0)) return plain;
  const glm::dvec3 texel(texel_of(scene, map, Encoding::Linear, surface.uv));
  const glm::dvec3 local = (2.0 * texel - 1.0) * glm::dvec3(scale, scale, 1.0);
  const glm::dvec3 mapped = local.x * surface.tangent + local.y * surface.bitangent + local.z * surface.shading_normal;
  const double length = glm::length(mapped);
  if (!(length > 0.0) || !(glm::dot(mapped, surface.to_viewer) > 0.0)) return plain;
  return mapped / length;
}

}  // namespace

glm::dvec3 absorption_of(const Material& material) {
  glm::dvec3 absorption(0.0);
  if (!std::isfinite(material.attenuation_distance)) return absorption;
  // What hides all but 1e-30 of the light hides all of it; held finite, so that no distance makes it NaN.
  constexpr double kMinLeft = 1e-30;
  constexpr double kMaxAbsorption = 1e30;
  for (int c = 0; c < 3; ++c) {
    const double left = std::clamp(static_cast<double>(material.attenuation_color[c]), kMinLeft, 1.0);
    absorption[c] = std::min(-std::log(left) / static_cast<double>(material.attenuation_distance), kMaxAbsorption);
  }
  return absorption;
}

glm::dvec3 normal_to_shade_with(const Scene& scene, const SurfacePoint& surface) {
  const Material& material = scene.materials[surface.material];
  return material.normal_texture.present()
             ? mapped_normal(scene, material.normal_texture, material.normal_scale, surface)
             : surface.facing_normal();
}

glm::dvec3 coat_normal_to_shade_with(const Scene& scene, const SurfacePoint& surface) {
  const Material& material = scene.materials[surface.material];
  if (!material.extensions || !material.extensions->clearcoat_normal_texture.present()) return surface.facing_normal();
  return mapped_normal(scene, material.extensions->clearcoat_normal_texture,
                       material.extensions->clearcoat_normal_scale, surface);
}

void set_channel(MaterialPoint& material, int channel, double scale) {
  material.channel = static_cast<std::uint8_t>(channel);
  material.channel_scale = static_cast<float>(scale);
  material.ior = std::max(material.ior + (channel - 1) * material.ior_spread, 1.0);
}

void choose_channel(MaterialPoint& material, const glm::dvec3& throughput, double u) {
  const double sum = throughput.r + throughput.g + throughput.b;
  if (!(sum > 0.0) || !std::isfinite(sum)) return;
  int channel = 0;
  double left = u * sum;
  while (channel < 2 && left >= throughput[channel]) left -= throughput[channel++];
  while (!(throughput[channel] > 0.0)) --channel;  // where rounding led past the last one with a share
  set_channel(material, channel, sum / throughput[channel]);
}

void prefetch_material(const Scene& scene, const SurfacePoint& surface) {
  if (scene.textures.empty()) return;
  const Material& material = scene.materials[surface.material];
  for (const TextureRef* const reference :
       {&material.base_color_texture, &material.metallic_roughness_texture, &material.normal_texture,
        &material.emissive_texture, &material.occlusion_texture, &material.transmission_texture}) {
    if (!reference->present()) continue;
    const glm::vec2& set = surface.uv[std::min<std::size_t>(reference->uv_set, surface.uv.size() - 1)];
    prefetch_texture(scene.textures[static_cast<std::size_t>(reference->texture)], transformed_uv(*reference, set));
  }
}

namespace {

/// Of unit length, tangent to the surface, rotated and textured as KHR_materials_anisotropy has it.
glm::dvec3 anisotropy_direction(const MaterialExtensions& from, const SurfacePoint& surface, const glm::dvec3& normal,
                                const glm::dvec2& texel) {
  const double angle = from.anisotropy_rotation_radians;
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  const glm::dvec2 rotated(c * texel.x - s * texel.y, s * texel.x + c * texel.y);
  glm::dvec3 direction = rotated.x * surface.tangent + rotated.y * surface.bitangent;
  direction -= glm::dot(direction, normal) * normal;
  const double length = glm::length(direction);
  if (length > 1e-6) return direction / length;
  const glm::dvec3 axis = std::abs(normal.x) < 0.9 ? glm::dvec3(1.0, 0.0, 0.0) : glm::dvec3(0.0, 1.0, 0.0);
  return glm::normalize(glm::cross(normal, axis));
}

/// Reads a surface's extensions: those of what lies on the material, and of the material itself.
class ExtensionReader {
 public:
  ExtensionReader(const Scene& scene, const SurfacePoint& surface, const MaterialExtensions& from)
      : scene_(scene), surface_(surface), from_(from) {}

  [[nodiscard]] ExtensionPoint read(const glm::dvec3& normal) const {
    ExtensionPoint point;
    point.specular = share(from_.specular, from_.specular_texture, 3);
    point.specular_color = color(from_.specular_color, from_.specular_color_texture);
    point.clearcoat = share(from_.clearcoat, from_.clearcoat_texture, 0);
    if (point.clearcoat > 0.0) {
      point.clearcoat_roughness = share(from_.clearcoat_roughness, from_.clearcoat_roughness_texture, 1);
      point.clearcoat_normal = coat_normal_to_shade_with(scene_, surface_);
    }
    point.sheen_color = glm::min(color(from_.sheen_color, from_.sheen_color_texture), 1.0);
    if (point.sheen_color != glm::dvec3(0.0)) {
      point.sheen_roughness = share(from_.sheen_roughness, from_.sheen_roughness_texture, 3);
    }
    point.iridescence = share(from_.iridescence, from_.iridescence_texture, 0);
    if (point.iridescence > 0.0) read_film(point);
    if (from_.anisotropy > 0.0F) read_anisotropy(normal, point);
    point.diffuse_transmission = share(from_.diffuse_transmission, from_.diffuse_transmission_texture, 3);
    if (point.diffuse_transmission > 0.0) {
      point.diffuse_transmission_color =
          glm::min(color(from_.diffuse_transmission_color, from_.diffuse_transmission_color_texture), 1.0);
    }
    return point;
  }

 private:
  [[nodiscard]] double share(float factor, const TextureRef& reference, int channel) const {
    double value = factor;
    if (reference.present() && value > 0.0) {
      value *= texel_of(scene_, reference, Encoding::Linear, surface_.uv)[channel];
    }
    return std::clamp(value, 0.0, 1.0);
  }
  [[nodiscard]] glm::dvec3 color(const glm::vec3& factor, const TextureRef& reference) const {
    const glm::dvec3 value(factor);
    if (!reference.present() || value == glm::dvec3(0.0)) return value;
    return value * glm::dvec3(texel_of(scene_, reference, Encoding::Srgb, surface_.uv));
  }
  void read_film(ExtensionPoint& point) const {
    const TextureRef& texture = from_.iridescence_thickness_texture;
    const double between = texture.present() ? texel_of(scene_, texture, Encoding::Linear, surface_.uv).g : 1.0;
    point.iridescence_ior = from_.iridescence_ior;
    point.iridescence_nm = from_.iridescence_min_nm * (1.0 - between) + from_.iridescence_max_nm * between;
  }
  void read_anisotropy(const glm::dvec3& normal, ExtensionPoint& point) const {
    glm::dvec4 texel(1.0, 0.5, 1.0, 1.0);
    if (from_.anisotropy_texture.present()) {
      texel = texel_of(scene_, from_.anisotropy_texture, Encoding::Linear, surface_.uv);
    }
    point.anisotropy = std::clamp(from_.anisotropy * texel.b, 0.0, 1.0);
    point.anisotropy_direction =
        anisotropy_direction(from_, surface_, normal, 2.0 * glm::dvec2(texel.r, texel.g) - 1.0);
  }

  const Scene& scene_;
  const SurfacePoint& surface_;
  const MaterialExtensions& from_;
};

bool has_effect(const ExtensionPoint& point) {
  return point.specular != 1.0 || point.specular_color != glm::dvec3(1.0) || point.clearcoat > 0.0 ||
         point.sheen_color != glm::dvec3(0.0) || point.anisotropy > 0.0 || point.iridescence > 0.0 ||
         point.diffuse_transmission > 0.0;
}

/// Dispersion as the extension has it: indices of the lines C, d and F for red, green and blue.
void add_extensions(const Scene& scene, const SurfacePoint& surface, const Material& material, MaterialPoint& point) {
  const MaterialExtensions& from = *material.extensions;
  constexpr double kHalfOfTwentieth = 0.025;
  if (material.thickness > 0.0F && point.ior > 1.0) {
    point.ior_spread = kHalfOfTwentieth * static_cast<double>(from.dispersion) * (point.ior - 1.0);
  }
  const ExtensionPoint read = ExtensionReader(scene, surface, from).read(point.normal);
  if (!has_effect(read)) return;
  point.extensions = std::make_shared<const ExtensionPoint>(read);
  const bool is_volume = material.thickness > 0.0F && (material.transmission > 0.0F || read.diffuse_transmission > 0.0);
  // Within solids there is no coat.
  if (!(is_volume && surface.inside)) point.emission *= coat_transmittance(read, surface.to_viewer);
  if (!(read.diffuse_transmission > 0.0) || !(material.thickness > 0.0F)) return;
  point.solid = true;
  point.absorption = absorption_of(material);
}

}  // namespace

MaterialPoint evaluate_material(const Scene& scene, const SurfacePoint& surface) {
  const Material& material = scene.materials[surface.material];
  const auto texel = [&](const TextureRef& reference, Encoding encoding) {
    return texel_of(scene, reference, encoding, surface.uv);
  };
  MaterialPoint point;
  glm::dvec4 base = glm::dvec4(material.base_color) * surface.color;
  if (material.base_color_texture.present()) base *= texel(material.base_color_texture, Encoding::Srgb);
  point.base_color = glm::clamp(glm::dvec3(base), 0.0, 1.0);
  point.alpha = coverage_of(material, base.a);
  point.normal = normal_to_shade_with(scene, surface);
  if (material.unlit) {
    point.unlit = true;
    point.emission = point.base_color;
    return point;
  }
  double metallic = material.metallic;
  double roughness = material.roughness;
  if (material.metallic_roughness_texture.present()) {
    const glm::dvec4 rough_metal = texel(material.metallic_roughness_texture, Encoding::Linear);
    metallic *= rough_metal.b;
    roughness *= rough_metal.g;
  }
  point.metallic = std::clamp(metallic, 0.0, 1.0);
  point.roughness = std::clamp(roughness, 0.0, 1.0);
  point.ior = material.ior;
  point.emission = glm::dvec3(material.emissive);
  if (material.emissive_texture.present()) {
    point.emission *= glm::dvec3(texel(material.emissive_texture, Encoding::Srgb));
  }
  if (material.occlusion_texture.present()) {
    const double open = texel(material.occlusion_texture, Encoding::Linear).r;
    point.occlusion = 1.0 + static_cast<double>(material.occlusion_strength) * (open - 1.0);
  }
  // What is not there for who looks from behind sends no light there either.
  if (surface.inside && !shows_both_sides(material)) point.emission = glm::dvec3(0.0);
  if (material.extensions) add_extensions(scene, surface, material, point);
  if (!(material.transmission > 0.0F)) return point;
  double transmission = material.transmission;
  if (material.transmission_texture.present()) {
    transmission *= texel(material.transmission_texture, Encoding::Linear).r;
  }
  point.transmission = std::clamp(transmission, 0.0, 1.0);
  point.solid = material.thickness > 0.0F;
  if (point.solid) point.absorption = absorption_of(material);
  return point;
}

double coat_transmittance(const ExtensionPoint& extensions, const glm::dvec3& direction) {
  constexpr double kCoatF0 = 0.04;  // of an index of 1.5
  if (!(extensions.clearcoat > 0.0)) return 1.0;
  const double rise = schlick_rise(std::abs(glm::dot(extensions.clearcoat_normal, direction)));
  return 1.0 - extensions.clearcoat * (kCoatF0 + (1.0 - kCoatF0) * rise);
}

double coverage_of(const Material& material, double alpha) {
  switch (material.alpha_mode) {
    case AlphaMode::Mask:
      // As the cutoff is rounded, so that what a file calls equal is.
      return static_cast<float>(alpha) >= material.alpha_cutoff ? 1.0 : 0.0;
    case AlphaMode::Blend:
      return std::clamp(alpha, 0.0, 1.0);
    case AlphaMode::Opaque:
      break;
  }
  return 1.0;
}

bool has_coverage(const Scene& scene) {
  return std::ranges::any_of(scene.materials, [](const Material& m) { return m.alpha_mode != AlphaMode::Opaque; });
}

double evaluate_alpha(const Scene& scene, const Material& material, const std::array<glm::vec2, 2>& uv,
                      double color_alpha) {
  if (material.alpha_mode == AlphaMode::Opaque) return 1.0;
  double alpha = static_cast<double>(material.base_color.a) * color_alpha;
  if (material.base_color_texture.present()) {
    alpha *= texel_of(scene, material.base_color_texture, Encoding::Srgb, uv).a;
  }
  return coverage_of(material, alpha);
}

}  // namespace hpr
