#include "scene/studio.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <numbers>
#include <vector>

#include "scene/requirements.h"

namespace hpr {
namespace {

/// A round lamp far away, whose edge fades.
struct Lamp {
  glm::dvec3 direction;  ///< of its middle, any length
  double radius_degrees;
  double radiance;
};

constexpr std::array<Lamp, 4> kLamps{{
    {{-0.6, 0.75, 0.65}, 22.0, 3.2},
    {{0.9, 0.5, 0.45}, 22.0, 1.4},
    {{0.0, 1.0, 0.0}, 24.0, 1.0},
    {{0.35, 0.6, -0.9}, 16.0, 2.4},
}};

constexpr double kFloor = 0.2;
constexpr double kHorizon = 0.35;
constexpr double kCeiling = 0.7;

double smooth_step(double x) {
  const double t = std::clamp(x, 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

constexpr double kEdge = 6.0;  // degrees, in which a lamp fades

/// A lamp, with what tells directions that it does not light at all.
struct LampCone {
  const Lamp* lamp;
  glm::dvec3 axis;  ///< unit length
  double cosine;    ///< of an angle past its edge
};

std::array<LampCone, kLamps.size()> lamp_cones() {
  std::array<LampCone, kLamps.size()> cones{};
  std::ranges::transform(kLamps, cones.begin(), [](const Lamp& lamp) {
    return LampCone{&lamp, glm::normalize(lamp.direction),
                    std::cos((lamp.radius_degrees + kEdge) * std::numbers::pi / 180.0)};
  });
  return cones;
}

double radiance_towards(const std::array<LampCone, kLamps.size()>& lamps, const glm::dvec3& direction) {
  const double up = direction.y;
  double radiance = up < 0.0 ? std::lerp(kHorizon, kFloor, smooth_step(-up)) : std::lerp(kHorizon, kCeiling, up * up);
  for (const auto& [lamp, axis, limit] : lamps) {
    const double cosine = std::clamp(glm::dot(direction, axis), -1.0, 1.0);
    if (cosine < limit) continue;
    const double degrees = std::acos(cosine) * 180.0 / std::numbers::pi;
    const double inside = smooth_step((lamp->radius_degrees - degrees) / kEdge + 0.5);
    radiance = std::lerp(radiance, lamp->radiance, inside);
  }
  return radiance;
}

/// What a material emits on average: of a texture a regular choice of texels.
double mean_emission(const Scene& scene, const Material& material) {
  const auto luminance = [](const glm::dvec3& color) { return glm::dot(color, glm::dvec3(0.2126, 0.7152, 0.0722)); };
  if (!emits(scene, material)) return 0.0;
  if (!material.emissive_texture.present()) return luminance(material.emissive);
  constexpr std::size_t kTexels = 65'536;
  const auto texels = scene.textures[static_cast<std::size_t>(material.emissive_texture.texture)].image.pixels();
  if (texels.empty()) return 0.0;
  // An odd step meets all columns of pictures whose sides are powers of two.
  const std::size_t step = std::max<std::size_t>(texels.size() / kTexels, 1) | 1U;
  glm::dvec3 sum(0.0);
  std::size_t count = 0;
  for (std::size_t i = 0; i < texels.size(); i += step, ++count) {
    const Rgb color = from_srgb(texels[i]);
    sum += glm::dvec3(color.r, color.g, color.b);
  }
  return luminance(glm::dvec3(material.emissive) * sum / static_cast<double>(count));
}

double area_of(const Scene& scene, const Instance& instance) {
  const Mesh& mesh = scene.mesh_of(instance);
  const glm::dmat3 linear(instance.to_world);
  double area = 0.0;
  for (const glm::uvec3& triangle : mesh.triangles) {
    const glm::dvec3 a(mesh.positions[triangle.x]);
    const glm::dvec3 ab = linear * (glm::dvec3(mesh.positions[triangle.y]) - a);
    const glm::dvec3 ac = linear * (glm::dvec3(mesh.positions[triangle.z]) - a);
    area += 0.5 * glm::length(glm::cross(ab, ac));
  }
  return area;
}

}  // namespace

Environment make_studio() {
  constexpr Size kSize{256, 128};
  Environment studio{Image<Rgb>(kSize)};
  std::vector<glm::dvec2> across;  // sine and cosine of each column's azimuth, from -z towards +x
  for (int x = 0; x < kSize.width; ++x) {
    const double azimuth = 2.0 * std::numbers::pi * ((x + 0.5) / kSize.width - 0.5);
    across.emplace_back(std::sin(azimuth), std::cos(azimuth));
  }
  const auto lamps = lamp_cones();
  for (int y = 0; y < kSize.height; ++y) {
    const double polar = std::numbers::pi * (y + 0.5) / kSize.height;
    const double sine = std::sin(polar);
    const double up = std::cos(polar);
    for (int x = 0; x < kSize.width; ++x) {
      const glm::dvec2& azimuth = across[static_cast<std::size_t>(x)];
      const auto radiance =
          static_cast<float>(radiance_towards(lamps, glm::dvec3(sine * azimuth.x, up, -sine * azimuth.y)));
      studio.image.at(x, y) = {radiance, radiance, radiance};
    }
  }
  return studio;
}

double emitted_radiance(const Scene& scene) {
  std::vector<double> emission;
  for (const Material& material : scene.materials) emission.push_back(mean_emission(scene, material));
  double power = 0.0;  // W, if all of them shine to one side
  for (const Instance& instance : scene.instances) {
    const double radiance = emission[scene.mesh_of(instance).material];
    if (radiance > 0.0) power += std::numbers::pi * radiance * area_of(scene, instance);
  }
  const double radius = 0.5 * glm::length(scene.bounds.high - scene.bounds.low);
  const double sphere = 4.0 * std::numbers::pi * radius * radius;
  return sphere > 0.0 ? power / (std::numbers::pi * sphere) : 0.0;
}

bool needs_studio(const Scene& scene) {
  return scene.lights.empty() && !scene.environment && emitted_radiance(scene) < kLitRadiance;
}

}  // namespace hpr
