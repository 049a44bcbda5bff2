#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <utility>
#include <vector>

#include "gpu/light/test_scenes.h"
#include "rt/lights/triangle_lights.h"
#include "rt/sampling/sampling.h"
#include "rt/test_scene.h"
#include "scene/scene.h"

/// Random lights and scenes of them, for tests that compare a device with the CPU.
namespace hpr::test {

inline constexpr std::size_t kInputs = 100'000;

/// Between two positive numbers, each power of ten as often.
inline double spread(Random& random, double low, double high) {
  return low * std::pow(high / low, random.number());
}

/// Of a surface: zero, along an axis, or any.
inline glm::dvec3 any_normal(Random& random) {
  if (random.chance(0.1)) return glm::dvec3(0.0);
  if (random.chance(0.1)) {
    glm::dvec3 axis(0.0);
    axis[static_cast<int>(random.below(3))] = random.chance(0.5) ? 1.0 : -1.0;
    return axis;
  }
  return random.direction();
}

/// Keeps the largest error of many numbers, relative to the expected ones; below `floor` to that.
class Errors {
 public:
  double of(double found, double expected, double floor = 1e-300) {
    if (found == expected) return 0.0;
    const double error = std::abs(found - expected) / std::max(std::abs(expected), floor);
    return std::isfinite(error) ? error : std::numeric_limits<double>::infinity();
  }
  void add(double found, double expected, double floor = 1e-300) { add(of(found, expected, floor)); }
  /// Relative to the vector's length.
  void add(const glm::dvec3& found, const glm::dvec3& expected, double floor = 1e-300) {
    const double size = std::max(glm::length(expected), floor);
    for (int k = 0; k < 3; ++k) add(of(found[k], expected[k], size));
  }
  [[nodiscard]] double largest() const { return largest_; }
  /// How many exceed 1e-9.
  [[nodiscard]] std::size_t large() const { return large_; }

 private:
  void add(double error) {
    largest_ = std::max(largest_, error);
    if (error > 1e-9) ++large_;
  }

  double largest_ = 0.0;
  std::size_t large_ = 0;
};

inline Light random_light(Random& random) {
  Light light;
  light.type = static_cast<LightType>(random.below(4));
  light.position = spread(random, 1e-2, 1e4) * random.direction();
  light.direction = glm::vec3(random.direction());
  light.intensity = glm::vec3(spread(random, 1e-3, 1e5) * abs(random.direction()));
  if (random.chance(0.3)) light.range = spread(random, 0.1, 1e3);
  light.outer_cone_radians =
      static_cast<float>(random.chance(0.2) ? spread(random, 1e-4, 0.1) : 1.57 * random.number());
  light.inner_cone_radians = light.outer_cone_radians * static_cast<float>(random.number());
  if (random.chance(0.5)) light.radius = spread(random, 1e-9, 10.0);
  if (random.chance(0.5)) light.angular_radius_radians = static_cast<float>(spread(random, 1e-4, 1.57));
  return light;
}

/// One pixel; an even picture; a pattern of few pixels; one bright texel in a dim sky, and in a black one; a column.
inline std::vector<Environment> environments() {
  std::vector<Environment> all;
  all.push_back({Image<Rgb>({1, 1}, {0.5F, 1.0F, 2.0F})});
  all.push_back({Image<Rgb>({1, 1})});
  all.push_back({Image<Rgb>({64, 32}, {1.0F, 0.5F, 0.25F})});
  Environment pattern{Image<Rgb>({7, 5})};
  Environment hills{Image<Rgb>({200, 100})};
  for (Environment* each : {&pattern, &hills}) {
    const Size size = each->image.size();
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const auto value = static_cast<float>((x * 5 + y * 3) % 7);
        each->image.at(x, y) = {value, static_cast<float>(x % 3), y < size.height / 2 ? 0.25F * value : 0.0F};
      }
    }
    each->rotation_radians = 0.7;
    each->scale = 2.0;
  }
  all.push_back(pattern);
  all.push_back(hills);
  Environment sunny{Image<Rgb>({128, 64}, {0.1F, 0.2F, 0.3F})};
  sunny.image.at(40, 11) = {5e4F, 4e4F, 3e4F};
  sunny.rotation_radians = -2.0;
  all.push_back(sunny);
  Environment night{Image<Rgb>({16, 8})};
  night.image.at(15, 7) = {5.0F, 5.0F, 5.0F};
  all.push_back(night);
  Environment bands{Image<Rgb>({1, 9})};
  for (int y = 0; y < 9; ++y) bands.image.at(0, y) = {static_cast<float>(y % 4), 1.0F, 0.0F};
  all.push_back(bands);
  return all;
}

inline Texture noise(Random& random, Size size) {
  Image<Rgba8> image(size);
  for (Rgba8& texel : image.pixels()) {
    const auto level = [&] { return static_cast<std::uint8_t>(random.below(256)); };
    texel = {level(), level(), level(), level()};
  }
  Texture texture;
  texture.image = std::move(image);
  return texture;
}

/// Materials that emit: from one side and from both, textured, cut out by an alpha that is blended, and by one that is
/// compared.
inline std::vector<Material> emitting_materials() {
  std::vector<Material> all(5, glowing({3.0F, 1.0F, 0.5F}));
  all[0].double_sided = false;
  all[2].emissive_texture.texture = 0;
  all[2].emissive_texture.transform = {2.0F, 0.5F, -0.5F, 1.5F, 0.25F, 0.125F};
  all[3].emissive_texture = {1, 1};
  all[3].alpha_mode = AlphaMode::Blend;
  all[3].base_color.a = 0.75F;
  all[3].double_sided = false;
  all[4].alpha_mode = AlphaMode::Mask;
  all[4].base_color_texture.texture = 0;
  return all;
}

/// Triangles of all sizes, blunt and acute, of each of the first of these materials, two of which have no texture, and
/// a copy of each mesh that is mirrored.
inline Scene with_triangles(Random& random, std::size_t of_each, std::size_t materials = 5) {
  Scene scene;
  scene.textures = {noise(random, {8, 4}), noise(random, {3, 5})};
  for (std::size_t m = 0; m < materials; ++m) {
    Mesh mesh;
    mesh.material = add_material(scene, emitting_materials()[m]);
    for (std::uint32_t i = 0; i < of_each; ++i) {
      const glm::dvec3 corner = 10.0 * random.number() * random.direction();
      const double size = spread(random, 1e-3, 5.0);
      const glm::dvec3 along = size * random.direction();
      const glm::dvec3 across = size * spread(random, 0.01, 1.0) * random.direction();
      for (const glm::dvec3& position : {corner, corner + along, corner + across}) {
        mesh.positions.emplace_back(position);
        mesh.uvs[0].emplace_back(3.0 * random.two() - 1.0);
        mesh.uvs[1].emplace_back(random.two());
        if (mesh.material == 3) mesh.colors.emplace_back(1.0F, 1.0F, 1.0F, random.number());
      }
      mesh.triangles.emplace_back(3 * i, 3 * i + 1, 3 * i + 2);
    }
    const std::uint32_t index = add_mesh(scene, mesh);
    place_mesh(scene, index);
    place_mesh(scene, index, glm::scale(glm::translate(glm::dmat4(1.0), {20, 5, 0}), {-1.0, 2.0, 1.0}));
  }
  finish_scene(scene);
  return scene;
}

/// Near and far, in its plane, at a corner, and where it fills half of what is seen.
inline glm::dvec3 position_about(Random& random, const TriangleLight& triangle) {
  const double size = std::max(glm::length(triangle.e1), glm::length(triangle.e2));
  const glm::dvec2 at = 0.5 * random.two();
  const glm::dvec3 point = triangle.v0 + at.x * triangle.e1 + at.y * triangle.e2;
  if (random.chance(0.01)) return triangle.v0;
  if (random.chance(0.05)) return point + size * spread(random, 1e-3, 10.0) * glm::normalize(triangle.e1);
  if (random.chance(0.2)) return point + size * spread(random, 1e-5, 1.0) * triangle.normal;
  return point + size * spread(random, 1e-2, 1e5) * random.direction();
}

}  // namespace hpr::test
