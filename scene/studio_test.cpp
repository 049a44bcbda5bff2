#include "scene/studio.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <utility>

#include "scene/load_scene.h"

namespace hpr {
namespace {

glm::dvec3 direction_of(const Size& size, int x, int y) {
  const double polar = std::numbers::pi * (y + 0.5) / size.height;
  const double azimuth = 2.0 * std::numbers::pi * (x + 0.5) / size.width;
  // The first column lies along +z, as the central one along -z.
  return {-std::sin(polar) * std::sin(azimuth), std::cos(polar), std::sin(polar) * std::cos(azimuth)};
}

/// The radiance of a white matte surface of that normal.
double white_facing(const Environment& environment, const glm::dvec3& normal) {
  const Size size = environment.image.size();
  double sum = 0.0;
  for (int y = 0; y < size.height; ++y) {
    const double row = 2.0 * std::numbers::pi / size.width * (std::numbers::pi / size.height) *
                       std::sin(std::numbers::pi * (y + 0.5) / size.height);
    for (int x = 0; x < size.width; ++x) {
      const double cosine = std::max(glm::dot(normal, direction_of(size, x, y)), 0.0);
      sum += row * cosine * static_cast<double>(environment.image.at(x, y).g);
    }
  }
  return sum / std::numbers::pi;
}

TEST(Studio, LightsWhiteAsDocumentedAndLeavesNoSideDark) {
  const Environment studio = make_studio();
  EXPECT_NEAR(white_facing(studio, {0.0, 1.0, 0.0}), 1.0, 0.05);
  EXPECT_NEAR(white_facing(studio, {0.0, 0.0, 1.0}), 0.65, 0.05);
  for (const glm::dvec3& normal :
       {glm::dvec3(1, 0, 0), glm::dvec3(-1, 0, 0), glm::dvec3(0, 0, -1), glm::dvec3(0, -1, 0)}) {
    EXPECT_GT(white_facing(studio, normal), 0.2);
    EXPECT_LT(white_facing(studio, normal), 1.0);
  }
}

TEST(Studio, IsGreyAndCalmAtTheHorizon) {
  const Environment studio = make_studio();
  const Size size = studio.image.size();
  for (const Rgb& color : studio.image.pixels()) EXPECT_TRUE(color.r == color.g && color.g == color.b);
  for (int x = 0; x < size.width; ++x) {
    EXPECT_NEAR(studio.image.at(x, size.height / 2).g, 0.35, 0.01);
    EXPECT_NEAR(studio.image.at(x, 0).g, 1.0, 0.01);
    EXPECT_NEAR(studio.image.at(x, size.height - 1).g, 0.2, 0.01);
  }
}

void add_square(Scene& scene, double side, double height, float radiance) {
  const auto s = static_cast<float>(0.5 * side);
  const auto y = static_cast<float>(height);
  Mesh mesh;
  mesh.positions = {{-s, y, -s}, {s, y, -s}, {s, y, s}, {-s, y, s}};
  mesh.normals.assign(4, {0.0F, 1.0F, 0.0F});
  mesh.triangles = {{0, 2, 1}, {0, 3, 2}};
  mesh.material = static_cast<std::uint32_t>(scene.materials.size());
  scene.materials.emplace_back().emissive = glm::vec3(radiance);
  scene.instances.push_back({.mesh = static_cast<std::uint32_t>(scene.meshes.size())});
  scene.meshes.push_back(std::move(mesh));
}

/// Floor and ceiling of a matte cube of `side` metres, and a square of `lamp_side` between that emits `radiance`.
Scene lamp_in_cube(double side, double lamp_side, float radiance) {
  Scene scene;
  add_square(scene, side, 0.0, 0.0F);
  add_square(scene, side, side, 0.0F);
  add_square(scene, lamp_side, 0.5 * side, radiance);
  finish_scene(scene);
  return scene;
}

TEST(Studio, ATinyEmitterChangesNothingAndALampIsEnough) {
  EXPECT_TRUE(needs_studio(lamp_in_cube(1.0, 0.001, 10.0F)));
  EXPECT_FALSE(needs_studio(lamp_in_cube(1.0, 0.5, 10.0F)));
  EXPECT_FALSE(needs_studio(lamp_in_cube(1.0, 0.001, 1e7F))) << "small and bright is a lamp";
  EXPECT_FALSE(needs_studio(load_scene("gen:cornell")));
}

TEST(Studio, SizesOfScenesDoNotMatter) {
  for (const double scale : {1e-3, 1.0, 1e4}) {
    const Scene scene = lamp_in_cube(scale, 0.5 * scale, 10.0F);
    EXPECT_NEAR(emitted_radiance(scene), emitted_radiance(lamp_in_cube(1.0, 0.5, 10.0F)), 1e-6) << scale;
  }
}

TEST(Studio, LightsAndEnvironmentsKeepItOut) {
  Scene scene = lamp_in_cube(1.0, 0.001, 0.0F);
  EXPECT_TRUE(needs_studio(scene));
  scene.lights.emplace_back();
  EXPECT_FALSE(needs_studio(scene));
  scene.lights.clear();
  scene.environment = Environment{Image<Rgb>({1, 1})};
  EXPECT_FALSE(needs_studio(scene)) << "a black one asks for darkness";
}

}  // namespace
}  // namespace hpr
