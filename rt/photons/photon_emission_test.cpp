// What LightSampler::emit sends out: the mean flux is the power, and it comes from where the light is.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <numbers>
#include <set>

#include "rt/lights/light_sampler.h"
#include "rt/sampling/sampler.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr std::uint32_t kPhotons = 65536;

Scene room(const glm::vec3& emission) {
  Scene scene;
  const std::uint32_t floor = test::add_material(scene, test::diffuse());
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-4, -4, 0}, {8, 0, 0}, {0, 8, 0}, floor)));
  const std::uint32_t glow = test::add_material(scene, test::glowing(emission));
  const std::uint32_t panel = test::add_mesh(scene, test::quad({-1, -1, 3}, {0, 2, 0}, {2, 0, 0}, glow));
  test::place_mesh(scene, panel);
  finish_scene(scene);
  return scene;
}

PhotonStart photon_of(const LightSampler& lights, std::uint32_t index) {
  Sampler sampler(photon_stream({}), index);
  const double u = sampler.one();
  const glm::dvec2 u_place = sampler.two();
  const auto photon = lights.emit(u, u_place, sampler.two());
  EXPECT_TRUE(photon.has_value());
  return *photon;
}

glm::dvec3 mean_flux(const LightSampler& lights) {
  glm::dvec3 sum(0.0);
  for (std::uint32_t i = 0; i < kPhotons; ++i) sum += photon_of(lights, i).flux;
  return sum / static_cast<double>(kPhotons);
}

double mean_of(const glm::dvec3& color) {
  return (color.r + color.g + color.b) / 3.0;
}

TEST(PhotonEmission, OfAnAreaLightIsItsRadianceTimesPiTimesItsAreaOnBothSides) {
  const Scene scene = room({3.0F, 6.0F, 0.0F});
  const LightSampler lights(scene);
  const double per_radiance = 2.0 * kPi * 4.0;
  EXPECT_NEAR(lights.power(), 3.0 * per_radiance, 1e-9);
  const glm::dvec3 flux = mean_flux(lights);
  EXPECT_NEAR(flux.r, 3.0 * per_radiance, 1e-6);
  EXPECT_NEAR(flux.g, 6.0 * per_radiance, 1e-6);
  EXPECT_EQ(flux.b, 0.0);
}

TEST(PhotonEmission, OfAnAreaLightLeavesItsSurfaceWithACosineLobe) {
  const Scene scene = room(glm::vec3(1.0F));
  const LightSampler lights(scene);
  glm::dvec3 squared(0.0);
  double cosine = 0.0;
  double down = 0.0;
  std::set<std::uint32_t> surfaces;
  for (std::uint32_t i = 0; i < kPhotons; ++i) {
    const PhotonStart photon = photon_of(lights, i);
    EXPECT_NEAR(photon.origin.z, 3.0, 1e-12);
    EXPECT_GT(photon.offset, 0.0);
    surfaces.insert(photon.surface);
    squared += photon.origin * photon.origin;
    cosine += std::abs(photon.direction.z);
    if (photon.direction.z < 0.0) ++down;
  }
  EXPECT_EQ(surfaces, (std::set<std::uint32_t>{2, 3}));
  EXPECT_NEAR(cosine / kPhotons, 2.0 / 3.0, 2e-3);
  EXPECT_NEAR(down / kPhotons, 0.5, 5e-3);
  EXPECT_NEAR(squared.x / kPhotons, 1.0 / 3.0, 5e-3) << "a square of side 2, evenly";
  EXPECT_NEAR(squared.y / kPhotons, 1.0 / 3.0, 5e-3);
}

TEST(PhotonEmission, OfATexturedEmitterFollowsItsTexture) {
  Scene scene = room(glm::vec3(2.0F));
  scene.textures.resize(1);
  Image<Rgba8> image({4, 4}, {0, 0, 0, 255});
  for (int i = 0; i < 4; ++i) image.at(i, i) = {255, static_cast<std::uint8_t>(60 * i), 0, 255};
  scene.textures[0].image = std::move(image);
  scene.materials[1].emissive_texture.texture = 0;
  const LightSampler lights(scene);
  const glm::dvec3 flux = mean_flux(lights);
  // A bilinear picture's mean is that of its texels: a quarter of them are red.
  EXPECT_NEAR(flux.r / (2.0 * kPi * 4.0 * 2.0 * 0.25), 1.0, 0.02);
  EXPECT_NEAR(lights.power() / mean_of(flux), 1.0, 0.05);
}

TEST(PhotonEmission, OfManyKindsOfLightTogetherIsTheirPower) {
  Scene scene = room({0.2F, 0.4F, 0.1F});
  Light point;
  point.position = {0, 0, 2};
  point.intensity = {1.0F, 2.0F, 3.0F};
  Light ball = point;
  ball.radius = 0.5;
  Light spot = point;
  spot.type = LightType::Spot;
  spot.outer_cone_radians = 0.4F;
  Light sun;
  sun.type = LightType::Directional;
  sun.intensity = glm::vec3(0.1F);
  sun.angular_radius_radians = 0.1F;
  scene.lights = {point, ball, spot, sun};
  scene.environment = Environment{Image<Rgb>({64, 32}, {0.01F, 0.02F, 0.01F})};
  scene.environment->image.at(23, 9) = {40.0F, 20.0F, 8.0F};
  const LightSampler lights(scene);
  const glm::dvec3 flux = mean_flux(lights);
  EXPECT_NEAR(mean_of(flux) / lights.power(), 1.0, 0.01);
  const double radius = 0.5 * glm::distance(scene.bounds.low, scene.bounds.high);
  const LitSphere lit{{}, radius};
  glm::dvec3 expected(0.0);
  for (const Light& light : scene.lights) expected += power_of(light, lit);
  expected += 2.0 * kPi * 4.0 * glm::dvec3(0.2, 0.4, 0.1);
  expected += 4.0 * kPi * kPi * radius * radius * EnvironmentMap(*scene.environment).mean();
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(flux[c] / expected[c], 1.0, 0.01) << c;
}

TEST(PhotonEmission, OfAConstantEnvironmentLightsAnUnobstructedSurfaceWithPiTimesItsRadiance) {
  Scene scene = room(glm::vec3(0.0F));
  scene.environment = Environment{Image<Rgb>({1, 1}, {2.0F, 2.0F, 2.0F})};
  const LightSampler lights(scene);
  double arriving = 0.0;  // on the upper side of the floor's square
  for (std::uint32_t i = 0; i < kPhotons; ++i) {
    const PhotonStart photon = photon_of(lights, i);
    EXPECT_EQ(photon.surface, 0xFFFFFFFFU);
    if (!(photon.direction.z < 0.0)) continue;
    const glm::dvec3 at = photon.origin - photon.origin.z / photon.direction.z * photon.direction;
    if (std::abs(at.x) < 4.0 && std::abs(at.y) < 4.0) arriving += photon.flux.r / kPhotons;
  }
  EXPECT_NEAR(arriving / 64.0 / (2.0 * kPi), 1.0, 0.01);
}

TEST(PhotonEmission, OfAFewBrightLightsAndManyDimOnesChoosesByPower) {
  Scene scene = room(glm::vec3(0.0F));
  for (int i = 0; i < 100; ++i) {
    Light light;
    light.position = {0.01 * i, 0, 1};
    light.intensity = glm::vec3(i == 50 ? 100.0F : 0.01F);
    scene.lights.push_back(light);
  }
  const LightSampler lights(scene);
  int bright = 0;
  for (std::uint32_t i = 0; i < 4096; ++i) {
    const PhotonStart photon = photon_of(lights, i);
    EXPECT_NEAR(photon.flux.r, lights.power(), 1e-6 * lights.power()) << "every photon carries the same";
    if (photon.origin.x == 0.01 * 50) ++bright;
  }
  EXPECT_NEAR(bright / 4096.0, 100.0 / 100.99, 0.005);
}

}  // namespace
}  // namespace hpr
