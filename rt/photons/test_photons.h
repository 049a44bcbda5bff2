#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <utility>

#include "rt/photons/photon_tracer.h"
#include "rt/test_rooms.h"
#include "rt/test_scene.h"

/// Rooms and photon sources for tests, without LightSampler.
namespace hpr::test {

/// The cube [-1, 1]^3 from inside, as six quads in the order -x +x -y +y -z +z: wall w is surfaces 2 w and 2 w + 1.
inline void add_room(Scene& scene, std::uint32_t material) {
  for (int wall = 0; wall < 6; ++wall) {
    const int axis = wall / 2;
    glm::vec3 corner(-1.0F);
    glm::vec3 a(0.0F);
    glm::vec3 b(0.0F);
    a[(axis + 1) % 3] = 2.0F;
    b[(axis + 2) % 3] = 2.0F;
    if (wall % 2 == 1) {
      corner[axis] = 1.0F;
      std::swap(a, b);
    }
    place_mesh(scene, add_mesh(scene, quad(corner, a, b, material)));
  }
}

inline constexpr double kRoomArea = 24.0;
constexpr int kFloor = 2;
constexpr int kCeiling = 3;

/// Clear solid glass: an index of 1.5, no tint.
inline Material clear_glass() {
  Material glass;
  glass.metallic = 0.0F;
  glass.roughness = 0.0F;
  glass.transmission = 1.0F;
  glass.thickness = 1.0F;
  return glass;
}

/// A closed box of one grey that emits, two of `size` a side: light is the same everywhere inside.
inline Scene furnace(float albedo, float emission, float size = 1.0F) {
  Scene scene;
  Material wall = test::diffuse(glm::vec3(albedo));
  wall.emissive = glm::vec3(emission);
  add_material(scene, wall);
  const auto side = [&](glm::vec3 corner, glm::vec3 a, glm::vec3 b) {
    place_mesh(scene, add_mesh(scene, quad(size * corner, size * a, size * b, 0)));
  };
  side({-1, -1, -1}, {2, 0, 0}, {0, 2, 0});
  side({-1, -1, 1}, {0, 2, 0}, {2, 0, 0});
  side({-1, -1, -1}, {0, 2, 0}, {0, 0, 2});
  side({1, -1, -1}, {0, 0, 2}, {0, 2, 0});
  side({-1, -1, -1}, {0, 0, 2}, {2, 0, 0});
  side({-1, 1, -1}, {2, 0, 0}, {0, 0, 2});
  finish_scene(scene);
  return scene;
}

/// Expects the sum of all reflections in a closed box that emits 1: 1 / (1 - albedo).
inline void expect_light_of_series(double albedo, const RaySettings& settings, std::uint32_t samples,
                                   const MakeTileShader& make_device = {}) {
  const Scene scene = furnace(static_cast<float>(albedo), 1.0F);
  const View view = view_from({0, 0, 0.5}, {0.1, 0.2, -1}, {8, 8}, scene, 0.5);
  const glm::dvec3 mean = mean_of(scene, view, settings, samples, nullptr, make_device);
  EXPECT_NEAR(mean.g * (1.0 - albedo), 1.0, 0.02) << "albedo " << albedo;
}

/// Expects one picture of a closed box of any size that emits as much as is wanted, in units of what it emits.
inline void expect_light_of_any_strength_and_size(const MakeTileShader& make_device = {}) {
  const auto picture = [&](int strength, int size) {
    const double scale = std::ldexp(1.0, size);
    const Scene scene = furnace(0.5F, std::ldexp(1.0F, strength), static_cast<float>(scale));
    const View view = view_from({0, 0, 0.5 * scale}, {0.1 * scale, 0.2 * scale, -scale}, {8, 8}, scene, 0.5);
    const Shaded lit = shade(scene, view, {.photons = 5'000, .global_photons = true}, make_device);
    std::vector<float> green;
    for (const Rgb& color : lit.image.pixels()) green.push_back(std::ldexp(color.g, -strength));
    return green;
  };
  const std::vector<float> one = picture(0, 0);
  EXPECT_GT(one.front(), 1.5F);
  // In watts most of these photons would lie outside of what floats reach, 2^-126 to 2^127.
  EXPECT_EQ(picture(-110, -5), one);
  EXPECT_EQ(picture(100, 25), one);
}

/// A scene with all that photons need.
struct PhotonRoom {
  explicit PhotonRoom(Scene built)
      : scene((finish_scene(built), std::move(built))), space(scene), surfaces(scene, space), rays(scene, space, 1) {}

  [[nodiscard]] PhotonTracer tracer(PhotonSource source, const PhotonSettings& settings = {}) const {
    return PhotonTracer(scene, surfaces, space, rays, std::move(source), settings);
  }
  [[nodiscard]] TracedPhotons trace(PhotonSource source, std::uint64_t photons,
                                    const PhotonSettings& settings = {}) const {
    return tracer(std::move(source), settings).trace({}, {0, photons}, photons);
  }

  Scene scene;
  RaySpace space;
  Surfaces surfaces;
  RayScene rays;
};

/// A direction about `normal`, by the cosine.
inline glm::dvec3 cosine_direction(const glm::dvec3& normal, const glm::dvec2& u) {
  const glm::dvec3 other = std::abs(normal.x) > 0.5 ? glm::dvec3(0.0, 1.0, 0.0) : glm::dvec3(1.0, 0.0, 0.0);
  const glm::dvec3 a = glm::normalize(glm::cross(normal, other));
  const glm::dvec3 b = glm::cross(normal, a);
  const double radius = std::sqrt(u.x);
  const double angle = 2.0 * std::numbers::pi * u.y;
  return radius * std::cos(angle) * a + radius * std::sin(angle) * b + std::sqrt(1.0 - u.x) * normal;
}

/// Every wall of a room glows with radiance 1.
inline PhotonSource glowing_room() {
  return [](double u_choice, const glm::dvec2& u_place, const glm::dvec2& u_direction) {
    const int wall = static_cast<int>(6.0 * u_choice);
    PhotonStart start;
    start.origin = {0.0, 2.0 * u_place.x - 1.0, 2.0 * u_place.y - 1.0};
    for (int i = 0; i < wall / 2; ++i) start.origin = {start.origin.z, start.origin.x, start.origin.y};
    start.origin[wall / 2] = wall % 2 == 0 ? -1.0 : 1.0;
    glm::dvec3 normal(0.0);
    normal[wall / 2] = -start.origin[wall / 2];
    start.direction = cosine_direction(normal, u_direction);
    start.flux = glm::dvec3(std::numbers::pi * kRoomArea);
    start.surface = static_cast<std::uint32_t>(2 * wall);
    start.offset = 1e-6;
    return std::optional(start);
  };
}

/// One watt straight along `direction`, from a square of half width `half` about `center`, the square's sides along a
/// and b.
inline PhotonSource beam(const glm::dvec3& center, const glm::dvec3& a, const glm::dvec3& b, double half) {
  return [=](double /*u_choice*/, const glm::dvec2& u_place, const glm::dvec2& /*u_direction*/) {
    PhotonStart start;
    start.origin = center + half * (2.0 * u_place.x - 1.0) * a + half * (2.0 * u_place.y - 1.0) * b;
    start.direction = glm::normalize(glm::cross(a, b));
    start.flux = glm::dvec3(1.0);
    return std::optional(start);
  };
}

inline glm::dvec3 flux_of(const std::vector<Photon>& photons) {
  glm::dvec3 sum(0.0);
  for (const Photon& photon : photons) sum += glm::dvec3(photon.flux[0], photon.flux[1], photon.flux[2]);
  return sum;
}

}  // namespace hpr::test
