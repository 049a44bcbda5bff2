#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <limits>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "rt/trace/surfaces.h"
#include "scene/scene.h"

namespace hpr::test {

/// Random inputs of tests that compare a device with the CPU, the awkward ones often among them.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  /// In [0, 1).
  double number() { return std::generate_canonical<double, 53>(engine_); }
  double between(double low, double high) { return low + (high - low) * number(); }
  std::uint32_t below(std::size_t count) { return static_cast<std::uint32_t>(engine_() % count); }
  bool chance(double probability) { return number() < probability; }
  glm::dvec2 two() { return {number(), number()}; }
  /// Of unit length.
  glm::dvec3 direction() {
    while (true) {
      const glm::dvec3 v = 2.0 * glm::dvec3(number(), number(), number()) - 1.0;
      const double length = glm::length(v);
      if (length > 0.1 && length <= 1.0) return v / length;
    }
  }
  /// Of a texture: inside, some periods off, on a texel's edge, huge, or no number.
  double coordinate() {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    constexpr std::array<double, 12> kOdd{0.0,   -0.0,      1.0,        -1.0,
                                          0.5,   2.0,       1e30,       -1e308,
                                          1e-30, kInfinity, -kInfinity, std::numeric_limits<double>::quiet_NaN()};
    switch (below(10)) {
      case 0:
        return kOdd.at(below(kOdd.size()));
      case 1:
        return between(-1e6, 1e6);
      case 2:
        return between(-1e11, 1e11);
      case 3:
        return static_cast<double>(below(33)) / 16.0 - 1.0;
      default:
        return between(-3.0, 4.0);
    }
  }
  glm::vec2 uv() { return {static_cast<float>(coordinate()), static_cast<float>(coordinate())}; }
  /// From `low` to `high`, or one of them.
  float factor(double low = 0.0, double high = 1.0) {
    return static_cast<float>(chance(0.15) ? low : chance(0.15) ? high : between(low, high));
  }
  glm::vec3 color(double high = 1.0) { return {factor(0.0, high), factor(0.0, high), factor(0.0, high)}; }
  /// To one of `textures`.
  TextureRef reference(std::size_t textures) {
    TextureRef made;
    made.texture = static_cast<std::int32_t>(below(textures));
    made.uv_set = below(3);
    if (chance(0.5)) {
      for (float& entry : made.transform) entry = static_cast<float>(between(-2.0, 2.0));
    }
    return made;
  }

 private:
  std::mt19937_64 engine_;
};

/// Of several sizes with all wraps, one of them empty, one even, two of the same image.
inline std::vector<Texture> random_textures(Random& random) {
  std::vector<Texture> textures(2);
  for (const Size size : {Size{1, 1}, Size{2, 3}, Size{7, 5}, Size{16, 16}}) {
    for (const Wrap wrap_s : {Wrap::Repeat, Wrap::MirroredRepeat, Wrap::ClampToEdge}) {
      Image<Rgba8> image(size);
      for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width; ++x) {
          const auto level = [&] { return static_cast<std::uint8_t>(random.below(256)); };
          image.at(x, y) = {level(), level(), level(), level()};
        }
      }
      Texture& texture = textures.emplace_back();
      texture.image = std::move(image);
      texture.wrap_s = wrap_s;
      texture.wrap_t = static_cast<Wrap>(random.below(3));
      texture.nearest = random.chance(0.3);
    }
  }
  Image<Rgba8> even({3, 3});
  for (int i = 0; i < 9; ++i) even.at(i % 3, i / 3) = {200, 100, 50, 25};
  textures[1].image = std::move(even);
  textures.push_back(textures.back());
  textures.back().nearest = !textures.back().nearest;
  return textures;
}

inline MaterialExtensions random_extensions(Random& random, std::size_t textures) {
  MaterialExtensions made;
  const auto maybe = [&](TextureRef& reference) {
    if (random.chance(0.4)) reference = random.reference(textures);
  };
  const auto has = [&] { return random.chance(0.4); };
  if (has()) made.specular = random.factor();
  if (has()) made.specular_color = random.color(2.0);
  if (has()) made.clearcoat = random.factor();
  made.clearcoat_roughness = random.chance(0.2) ? 0.0F : random.factor(0.0005, 1.0);
  made.clearcoat_normal_scale = random.factor(0.0, 2.0);
  if (has()) made.sheen_color = random.color(1.2);
  made.sheen_roughness = random.factor();
  if (has()) made.anisotropy = random.factor();
  made.anisotropy_rotation_radians = random.factor(-7.0, 7.0);
  if (has()) made.iridescence = random.factor();
  made.iridescence_ior = random.factor(1.0, 2.4);
  made.iridescence_min_nm = random.factor(0.0, 300.0);
  made.iridescence_max_nm = random.factor(200.0, 1000.0);
  if (has()) made.dispersion = random.factor(0.0, 5.0);
  if (has()) made.diffuse_transmission = random.factor();
  made.diffuse_transmission_color = random.color(1.2);
  for (TextureRef* const reference :
       {&made.specular_texture, &made.specular_color_texture, &made.clearcoat_texture,
        &made.clearcoat_roughness_texture, &made.clearcoat_normal_texture, &made.sheen_color_texture,
        &made.sheen_roughness_texture, &made.anisotropy_texture, &made.iridescence_texture,
        &made.iridescence_thickness_texture, &made.diffuse_transmission_texture,
        &made.diffuse_transmission_color_texture}) {
    maybe(*reference);
  }
  return made;
}

inline Material random_material(Random& random, std::size_t textures) {
  Material made;
  made.base_color = glm::vec4(random.color(1.1), random.chance(0.2) ? 0.5F : random.factor());
  made.metallic = random.factor();
  made.roughness = random.factor();
  made.emissive = random.color(5.0);
  made.normal_scale = random.factor(0.0, 2.0);
  made.occlusion_strength = random.factor();
  if (random.chance(0.5)) made.transmission = random.factor();
  made.ior = std::array{0.0F, 1.0F, 1.33F, 1.5F, 2.4F}.at(random.below(5));
  if (random.chance(0.5)) made.thickness = 1.0F;
  made.attenuation_color = random.color();
  if (random.chance(0.7)) made.attenuation_distance = random.factor(0.01, 3.0);
  made.alpha_mode = static_cast<AlphaMode>(random.below(3));
  made.alpha_cutoff = random.chance(0.3) ? 0.5F : random.factor();
  made.double_sided = random.chance(0.5);
  made.unlit = random.chance(0.1);
  for (TextureRef* const reference : {&made.base_color_texture, &made.metallic_roughness_texture, &made.normal_texture,
                                      &made.emissive_texture, &made.occlusion_texture, &made.transmission_texture}) {
    if (random.chance(0.4)) *reference = random.reference(textures);
  }
  if (random.chance(0.5)) {
    made.extensions = std::make_shared<const MaterialExtensions>(random_extensions(random, textures));
  }
  return made;
}

/// As PlainSurface in test_surfaces.glsl.
struct PlainSurface {
  glm::dvec3 to_viewer{0.0};
  glm::dvec3 geometric_normal{0.0};
  glm::dvec3 shading_normal{0.0};
  glm::dvec3 tangent{0.0};
  glm::dvec3 bitangent{0.0};
  glm::dvec4 color{1.0};
  std::array<glm::vec2, 2> uv{};
  std::uint32_t material = 0;
  std::uint32_t inside = 0;

  [[nodiscard]] SurfacePoint surface() const {
    SurfacePoint point;
    point.to_viewer = to_viewer;
    point.geometric_normal = geometric_normal;
    point.shading_normal = shading_normal;
    point.tangent = tangent;
    point.bitangent = bitangent;
    point.color = color;
    point.uv = uv;
    point.material = material;
    point.inside = inside != 0;
    return point;
  }
};

/// Off `normal` on its side, often at a grazing angle or straight above.
inline glm::dvec3 random_above(Random& random, const glm::dvec3& normal) {
  if (random.chance(0.03)) return normal;
  const glm::dvec3 any = random.direction();
  const glm::dvec3 level = glm::normalize(glm::cross(normal, any));
  const double cosine = random.chance(0.2) ? std::exp(random.between(-25.0, 0.0)) : random.number();
  return glm::normalize(cosine * normal + std::sqrt(1.0 - cosine * cosine) * level);
}

inline PlainSurface random_surface(Random& random, std::size_t materials) {
  PlainSurface made;
  made.geometric_normal = random.direction();
  made.to_viewer = random_above(random, made.geometric_normal);
  made.shading_normal = made.geometric_normal;
  if (random.chance(0.6)) {
    made.shading_normal = glm::normalize(made.geometric_normal + random.number() * random.direction());
    if (!(glm::dot(made.shading_normal, made.geometric_normal) > 0.0)) made.shading_normal = made.geometric_normal;
  }
  if (random.chance(0.8)) {
    made.tangent = glm::normalize(glm::cross(made.shading_normal, random.direction()));
    made.bitangent = (random.chance(0.5) ? 1.0 : -1.0) * glm::cross(made.shading_normal, made.tangent);
  }
  if (random.chance(0.5)) made.color = {random.number(), random.number(), random.number(), random.number()};
  made.uv = {random.uv(), random.uv()};
  made.material = random.below(materials);
  made.inside = random.below(2);
  return made;
}

}  // namespace hpr::test
