#include <gtest/gtest.h>

#include "rt/deferred_shader.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

using test::add_material;
using test::add_mesh;
using test::place_mesh;
using test::quad;

constexpr double kWall = 2.0;

/// A glowing wall at z = -5 seen straight on through whatever `add` puts before it.
template <typename Add>
double seen_through(const Add& add, const RaySettings& settings = {.max_depth = 60}) {
  Scene scene;
  add_material(scene, test::glowing(glm::vec3(kWall)));
  place_mesh(scene, add_mesh(scene, quad({-500, -500, -5}, {1000, 0, 0}, {0, 1000, 0}, 0)));
  add(scene);
  finish_scene(scene);
  const View view = test::view_from({0, 0, 5}, {0, 0, 0}, {1, 1}, scene, 1e-4);
  return test::mean_pixel(scene, view, 0, 0, 2048, settings).r;
}

/// Two faces of a solid slab between z = -thickness and 0, or a sheet at 0.
auto pane(const Material& material, float thickness) {
  return [material, thickness](Scene& scene) {
    const std::uint32_t glass = add_material(scene, material);
    place_mesh(scene, add_mesh(scene, quad({-50, -50, 0}, {100, 0, 0}, {0, 100, 0}, glass)));
    if (thickness == 0.0F) return;
    place_mesh(scene, add_mesh(scene, quad({-50, -50, -thickness}, {0, 100, 0}, {100, 0, 0}, glass)));
  };
}

double straight_reflectance(double ior) {
  return (ior - 1.0) * (ior - 1.0) / ((ior + 1.0) * (ior + 1.0));
}

TEST(Refraction, ASlabLetsThroughWhatItsTwoFacesDoNotReflect) {
  for (const float ior : {1.0F, 1.0001F, 1.5F, 3.0F}) {
    const double r = straight_reflectance(ior);
    // All orders of reflection between the faces: (1 - r)^2 / (1 - r^2).
    const double expected = kWall * (1.0 - r) / (1.0 + r);
    EXPECT_NEAR(seen_through(pane(test::clear_glass(ior, 1.0F), 1.0F)) / expected, 1.0, ior < 2.0F ? 5e-3 : 2e-2)
        << ior;  // an ior of 3 reflects a quarter, by chance
  }
}

TEST(Refraction, ASheetIsCrossedStraight) {
  const double through = seen_through(pane(test::clear_glass(1.5F, 0.0F), 0.0F));
  EXPECT_GT(through, 0.9 * kWall);
  EXPECT_LE(through, kWall * (1.0 + 1e-6));
  Material red = test::clear_glass(1.5F, 0.0F);
  red.base_color = {0.5F, 1.0F, 1.0F, 1.0F};
  EXPECT_NEAR(seen_through(pane(red, 0.0F)) / through, 0.5, 0.05);
}

TEST(Refraction, AVolumeAbsorbsByItsThickness) {
  Material dark = test::clear_glass(1.0F, 1.0F);
  dark.attenuation_color = glm::vec3(0.5F);
  dark.attenuation_distance = 2.0F;
  EXPECT_NEAR(seen_through(pane(dark, 2.0F)) / kWall, 0.5, 1e-3);
  EXPECT_NEAR(seen_through(pane(dark, 4.0F)) / kWall, 0.25, 1e-3);
}

TEST(Refraction, OffLetsNothingThrough) {
  EXPECT_EQ(seen_through(pane(test::clear_glass(1.5F, 1.0F), 1.0F), {.passes = {PassId::Shadow}}), 0.0);
}

TEST(Refraction, AGlassBallUnderAnEvenSkyIsAsBrightAsTheSky) {
  Scene scene;
  const std::uint32_t glass = add_material(scene, test::clear_glass(1.5F, 1.0F));
  Mesh ball = test::sphere(1.0, 64, glass);
  place_mesh(scene, add_mesh(scene, ball));
  scene.environment = test::even_light({1.0F, 1.0F, 1.0F});
  finish_scene(scene);
  const View view = test::view_from({0, 0, 4}, {0, 0, 0}, {16, 16}, scene, 0.6);
  RaySettings settings{.max_depth = 60};
  // Faceted shading: with smooth normals a mesh of flat triangles neither keeps nor loses exactly all light.
  double sum = 0.0;
  for (const int x : {4, 8, 11}) sum += test::mean_pixel(scene, view, x, 7, 512, settings).g / 3.0;
  EXPECT_NEAR(sum, 1.0, 0.01);
}

TEST(Refraction, CountsItsRaysAndItsShareOfTheColour) {
  Scene scene;
  add_material(scene, test::glowing(glm::vec3(1.0F)));
  place_mesh(scene, add_mesh(scene, quad({-50, -50, -5}, {100, 0, 0}, {0, 100, 0}, 0)));
  pane(test::clear_glass(1.5F, 1.0F), 1.0F)(scene);
  finish_scene(scene);
  const View view = test::view_from({0, 0, 5}, {0, 0, 0}, {8, 8}, scene, 0.1);
  const TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
  TileLayer<Rgb> color(keys.layout());
  TileLayer<Rgb> refraction(keys.layout());
  TileLayer<Rgb> reflection(keys.layout());
  TileLayer<float> cost(keys.layout());
  LightOutput output{.radiance = &color, .cost = &cost};
  output.components[static_cast<std::size_t>(Component::Refraction)] = &refraction;
  output.components[static_cast<std::size_t>(Component::Reflection)] = &reflection;
  DeferredShader shader(scene, {});
  shader.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), output);
  EXPECT_GE(shader.counts()[PassId::Refraction], 128U) << "into the slab and out of it, in every pixel";
  const auto rays =
      shader.counts()[PassId::Shadow] + shader.counts()[PassId::Reflection] + shader.counts()[PassId::Refraction];
  double charged = 0.0;
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) {
      charged += static_cast<double>(cost.at(0, x, y));
      EXPECT_NEAR(refraction.at(0, x, y).g + reflection.at(0, x, y).g, color.at(0, x, y).g, 1e-6F);
    }
  }
  EXPECT_EQ(charged, static_cast<double>(rays));
}

}  // namespace
}  // namespace hpr
