#include "rt/lights/triangle_lights.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <memory>
#include <numbers>

#include "rt/sampling/sampler.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

constexpr std::uint32_t kSamples = 16384;

/// One triangle of radiance (3, 1, 0.5) over the floor, facing down.
Scene lamp(double size, double height) {
  Scene scene;
  const std::uint32_t material = test::add_material(scene, test::glowing({3.0F, 1.0F, 0.5F}));
  Mesh mesh;
  mesh.positions = {{-1, -1, 0}, {-1, 2, 0}, {2, -1, 0}};
  mesh.uvs[0] = {{0, 0}, {0, 1}, {1, 0}};
  mesh.triangles = {{0, 1, 2}};
  mesh.material = material;
  const std::uint32_t index = test::add_mesh(scene, mesh);
  test::place_mesh(scene, index,
                   glm::scale(glm::translate(glm::dmat4(1.0), glm::dvec3(0, 0, height)), glm::dvec3(size, size, 1.0)));
  finish_scene(scene);
  return scene;
}

/// On the floor below its middle.
double estimated_irradiance(const TriangleLights& lights, const glm::dvec3& position) {
  double sum = 0.0;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const LightSample sample = lights.sample(0, position, Sampler(1, i).two());
    sum += sample.weight.r * std::abs(sample.to_light.z);
  }
  return sum / kSamples;
}

double exact_irradiance(const TriangleLight& light, const glm::dvec3& position) {
  const glm::dvec3 corners[3] = {light.v0 - position, light.v0 + light.e1 - position, light.v0 + light.e2 - position};
  double sum = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    const glm::dvec3 cross = glm::cross(corners[i], corners[(i + 1) % 3]);
    sum += std::atan2(glm::length(cross), glm::dot(corners[i], corners[(i + 1) % 3])) * cross.z / glm::length(cross);
  }
  return 3.0 * std::abs(0.5 * sum);
}

TEST(TriangleLights, GiveLambertsIrradianceNearAndFarAndFromBothSides) {
  for (const double size : {1.0, 1e-2, 1e-4}) {
    const Scene scene = lamp(size, 1.0);
    const TriangleLights lights(scene);
    ASSERT_EQ(lights.size(), 1U);
    for (const glm::dvec3 position : {glm::dvec3(0.0), glm::dvec3(0.1, 0.2, 0.9), glm::dvec3(0.1, 0.1, 2.0)}) {
      EXPECT_NEAR(estimated_irradiance(lights, position) / exact_irradiance(lights[0], position), 1.0, 2e-3) << size;
    }
  }
}

TEST(TriangleLights, TheDensityOfASampleIsFoundAgainFromItsPlace) {
  for (const double size : {1.0, 1e-2, 1e-4}) {
    const Scene scene = lamp(size, 1.0);
    const TriangleLights lights(scene);
    for (std::uint32_t i = 0; i < 1000; ++i) {
      const glm::dvec3 position(0.3, -0.2, 0.1);
      const LightSample sample = lights.sample(0, position, Sampler(2, i).two());
      ASSERT_GT(sample.pdf, 0.0);
      EXPECT_EQ(lights.pdf(0, position, sample.goal), sample.pdf);
    }
  }
}

TEST(TriangleLights, WhatTheAlphaOfVertexColorsTakesEmitsNothing) {
  Scene scene = lamp(1.0, 1.0);
  scene.meshes[0].colors.assign(3, {1.0F, 1.0F, 1.0F, 0.25F});
  const TriangleLights opaque(scene);
  const double bright = estimated_irradiance(opaque, glm::dvec3(0.0));
  scene.materials[0].alpha_mode = AlphaMode::Blend;
  const TriangleLights veil(scene);
  ASSERT_EQ(veil.size(), 1U);
  EXPECT_NEAR(veil[0].mean.r, 0.25 * opaque[0].mean.r, 1e-6);
  EXPECT_NEAR(estimated_irradiance(veil, glm::dvec3(0.0)), 0.25 * bright, 1e-6);
  scene.materials[0].alpha_mode = AlphaMode::Mask;
  EXPECT_EQ(TriangleLights(scene).size(), 0U);
  // Alpha reaches the cutoff half way from the first corner to the other side.
  scene.meshes[0].colors[1].a = scene.meshes[0].colors[2].a = 0.75F;
  const TriangleLights half(scene);
  ASSERT_EQ(half.size(), 1U);
  for (std::uint32_t i = 0; i < 100; ++i) {
    const LightSample sample = half.sample(0, glm::dvec3(0.0), Sampler(5, i).two());
    EXPECT_EQ(sample.weight.r > 0.0, sample.goal.x + sample.goal.y >= -0.5) << sample.goal.x << ' ' << sample.goal.y;
  }
}

TEST(TriangleLights, TexturesAreReadWhereTheSampleFalls) {
  Scene scene = lamp(1.0, 1.0);
  scene.textures.resize(1);
  scene.textures[0].nearest = true;
  scene.textures[0].wrap_s = scene.textures[0].wrap_t = Wrap::ClampToEdge;
  Image<Rgba8> image({2, 1}, {0, 0, 0, 255});
  image.at(1, 0) = {255, 255, 255, 255};
  scene.textures[0].image = std::move(image);
  scene.materials[0].emissive_texture.texture = 0;
  const TriangleLights lights(scene);
  ASSERT_EQ(lights.size(), 1U);
  // White where u is past a half: a quarter of the triangle.
  EXPECT_NEAR(lights[0].mean.r, 0.75, 0.2);
  double flux = 0.0;
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const LightSample sample = lights.sample(0, glm::dvec3(0.0), Sampler(3, i).two());
    EXPECT_EQ(sample.weight.r > 0.0, sample.goal.x > 0.5);
    Sampler sampler(4, i);
    const double side = sampler.one();
    const glm::dvec2 position = sampler.two();
    flux += lights.emit(0, side, position, sampler.two()).flux.r / kSamples;
  }
  EXPECT_NEAR(flux, 2.0 * std::numbers::pi * 4.5 * 0.75, 0.05);
}

TEST(TriangleLights, ACoatDimsThemTheMoreTheyAreSeenAslant) {
  Scene scene = lamp(1.0, 1.0);
  MaterialExtensions extensions;
  extensions.clearcoat = 0.75F;
  scene.materials[0].extensions = std::make_shared<const MaterialExtensions>(extensions);
  const TriangleLights lights(scene);
  const auto left = [](double cosine) { return 1.0 - 0.75 * (0.04 + 0.96 * std::pow(1.0 - cosine, 5.0)); };
  for (std::uint32_t i = 0; i < 64; ++i) {
    Sampler sampler(3, i);
    const glm::dvec3 position(i % 8, i / 8, 0.05);
    const LightSample sample = lights.sample(0, position, sampler.two());
    EXPECT_NEAR(sample.weight.r * sample.pdf, 3.0 * left(sample.to_light.z), 1e-9);
    const PhotonStart photon = lights.emit(0, 0.3, sampler.two(), sampler.two());
    EXPECT_NEAR(photon.flux.r / lights.power(0).r, left(std::abs(photon.direction.z)), 1e-9);
  }
}

TEST(TriangleLights, TrianglesATextureLeavesBlackAreNoLights) {
  Scene scene = lamp(1.0, 1.0);
  scene.textures.resize(1);
  Image<Rgba8> image({64, 64}, {0, 0, 0, 255});
  image.at(63, 63) = {255, 255, 255, 255};
  scene.textures[0].image = std::move(image);
  scene.textures[0].wrap_s = scene.textures[0].wrap_t = Wrap::ClampToEdge;
  scene.materials[0].emissive_texture.texture = 0;
  scene.meshes[0].uvs[0] = {{0.1F, 0.1F}, {0.2F, 0.1F}, {0.1F, 0.2F}};
  EXPECT_EQ(TriangleLights(scene).size(), 0U);
  scene.meshes[0].uvs[0] = {{0.9F, 0.9F}, {0.99F, 0.9F}, {0.9F, 0.99F}};
  EXPECT_EQ(TriangleLights(scene).size(), 1U) << "its box of texels holds the bright one";
  scene.meshes[0].uvs[0] = {{0.1F, 0.1F}, {40.2F, 0.1F}, {0.1F, 40.2F}};
  EXPECT_EQ(TriangleLights(scene).size(), 1U) << "too many texels to look at";
}

TEST(TriangleLights, WhatIsCutOutEmitsNothing) {
  Scene scene = lamp(1.0, 1.0);
  scene.materials[0].alpha_mode = AlphaMode::Mask;
  scene.materials[0].base_color.a = 0.4F;
  const TriangleLights cut(scene);
  for (std::size_t i = 0; i < cut.size(); ++i) EXPECT_EQ(cut.sample(i, {0, 0, 0}, {0.3, 0.4}).weight.r, 0.0);
  scene.materials[0].alpha_mode = AlphaMode::Blend;
  const TriangleLights thin(scene);
  EXPECT_NEAR(estimated_irradiance(thin, glm::dvec3(0.0)), 0.4 * exact_irradiance(thin[0], glm::dvec3(0.0)), 1e-2);
}

TEST(TriangleLights, AreFoundByTheirSurfaceInEveryInstance) {
  Scene scene = lamp(1.0, 1.0);
  const std::uint32_t dark = test::add_material(scene, test::diffuse());
  test::place_mesh(scene, test::add_mesh(scene, test::quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, dark)));
  test::place_mesh(scene, 0, glm::translate(glm::dmat4(1.0), glm::dvec3(9, 0, 0)));
  test::place_mesh(scene, 0, glm::dmat4(0.0));  // singular: all in one point
  scene.instances.back().to_world[3] = glm::dvec4(0, 0, 0, 1);
  finish_scene(scene);
  const TriangleLights lights(scene);
  ASSERT_EQ(lights.size(), 2U);
  EXPECT_EQ(lights.find(0), 0U);
  EXPECT_EQ(lights.find(1), std::nullopt);
  EXPECT_EQ(lights.find(3), 1U);
  EXPECT_EQ(lights.find(4), std::nullopt);
  EXPECT_EQ(lights[1].v0.x, lights[0].v0.x + 9.0);
}

TEST(TriangleLights, NoPlaceGivesNan) {
  const Scene scene = lamp(1.0, 0.0);
  const TriangleLights lights(scene);
  for (const glm::dvec3 position : {glm::dvec3(0.0), glm::dvec3(-1, -1, 0), glm::dvec3(0.5, 0, 0), glm::dvec3(7, 0, 0),
                                    glm::dvec3(0, 0, 1e-200), glm::dvec3(0, 0, 1e200), glm::dvec3(1e300)}) {
    for (std::uint32_t i = 0; i < 64; ++i) {
      const LightSample sample = lights.sample(0, position, Sampler(5, i).two());
      EXPECT_TRUE(std::isfinite(sample.weight.r) && std::isfinite(sample.pdf) && std::isfinite(sample.to_light.x));
      EXPECT_TRUE(std::isfinite(lights.pdf(0, position, sample.goal)));
    }
  }
}

}  // namespace
}  // namespace hpr
