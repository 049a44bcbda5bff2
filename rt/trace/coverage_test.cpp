#include <gtest/gtest.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "rt/deferred_shader.h"
#include "rt/test_scene.h"
#include "rt/trace/coverage_traversal.h"

// Surfaces of partial coverage: alpha MASK and BLEND.
namespace hpr {
namespace {

using test::add_material;
using test::add_mesh;
using test::place_mesh;
using test::quad;

Material veil(float alpha, float radiance) {
  Material material = test::glowing(glm::vec3(radiance));
  material.alpha_mode = AlphaMode::Blend;
  material.base_color.a = alpha;
  return material;
}

void add_wall(Scene& scene, float z, const Material& material) {
  const std::uint32_t index = add_material(scene, material);
  place_mesh(scene, add_mesh(scene, quad({-500, -500, z}, {1000, 0, 0}, {0, 1000, 0}, index)));
}

/// Keys of the opaque surfaces alone, as the raster makes them.
TileLayer<Key> opaque_keys(const Scene& scene, const View& view) {
  Scene opaque = scene;
  for (Instance& instance : opaque.instances) {
    if (scene.materials[scene.mesh_of(instance).material].alpha_mode != AlphaMode::Opaque)
      instance.to_world = glm::dmat4(0.0);
  }
  return test::cast_keys(opaque, std::span(&view, 1));
}

/// The mean of so many samples.
glm::dvec3 seen_on_average(const Scene& scene, const RaySettings& settings, std::uint32_t samples,
                           RayCounts* counts = nullptr) {
  const View view = test::view_from({0, 0, 5}, {0, 0, 0}, {1, 1}, scene, 1e-4);
  const TileLayer<Key> keys = opaque_keys(scene, view);
  TileLayer<Rgb> color(keys.layout());
  DeferredShader shader(scene, settings);
  glm::dvec3 sum(0.0);
  for (std::uint32_t sample = 0; sample < samples; ++sample) {
    shader.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &color}, {.sample = sample});
    const Rgb& one = color.at(0, 0, 0);
    sum += glm::dvec3(one.r, one.g, one.b);
    if (counts != nullptr) *counts += shader.counts();
  }
  return sum / static_cast<double>(samples);
}

glm::vec3 seen(const Scene& scene, const RaySettings& settings = {}) {
  return seen_on_average(scene, settings, 1);
}

TEST(Coverage, VeilsAreMixedByTheirAlphaNearestFirst) {
  Scene scene;
  add_wall(scene, -5, test::glowing(glm::vec3(8.0F)));
  add_wall(scene, 0, veil(0.25F, 2.0F));
  add_wall(scene, 1, veil(0.5F, 4.0F));
  finish_scene(scene);
  EXPECT_NEAR(seen(scene).g, 0.5 * 4.0 + 0.5 * (0.25 * 2.0 + 0.75 * 8.0), 1e-5);
}

/// Radiance and the fraction of the pixel that is covered.
std::pair<float, float> seen_before(const Background& background, const Scene& scene, RaySettings settings = {}) {
  settings.background = background;
  const View view = test::view_from({0, 0, 5}, {0, 0, 0}, {1, 1}, scene, 1e-4);
  const TileLayer<Key> keys = opaque_keys(scene, view);
  TileLayer<Rgb> color(keys.layout());
  TileLayer<float> coverage(keys.layout());
  DeferredShader shader(scene, settings);
  shader.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &color, .coverage = &coverage});
  return {color.at(0, 0, 0).g, coverage.at(0, 0, 0)};
}

TEST(Coverage, VeilsCoverByTheirAlphaWhateverIsBehind) {
  Scene scene;
  add_wall(scene, 0, veil(0.25F, 2.0F));
  add_wall(scene, 1, veil(0.5F, 4.0F));
  scene.environment = test::even_light({7.0F, 7.0F, 7.0F});
  finish_scene(scene);
  const double front = 0.5 * 4.0 + 0.5 * 0.25 * 2.0;
  const std::vector<std::pair<Background, double>> backgrounds{
      {{}, 7.0}, {{Background::Kind::Color, {1.0F, 3.0F, 5.0F}}, 3.0}, {{Background::Kind::Transparent, {}}, 0.0}};
  for (const auto& [background, behind] : backgrounds) {
    const auto [color, covered] = seen_before(background, scene);
    EXPECT_NEAR(color, front + 0.5 * 0.75 * behind, 1e-5);
    EXPECT_NEAR(covered, 1.0 - 0.5 * 0.75, 1e-6);
  }
}

TEST(Coverage, AWallCoversAllAndNothingNothing) {
  Scene wall;
  add_wall(wall, 0, test::glowing(glm::vec3(8.0F)));
  finish_scene(wall);
  EXPECT_EQ(seen_before({Background::Kind::Transparent, {}}, wall), std::pair(8.0F, 1.0F));
  Scene empty;
  empty.environment = test::even_light({7.0F, 7.0F, 7.0F});
  finish_scene(empty);
  EXPECT_EQ(seen_before({Background::Kind::Transparent, {}}, empty), std::pair(0.0F, 0.0F));
  EXPECT_EQ(seen_before({}, empty), std::pair(7.0F, 0.0F));
}

TEST(Coverage, AVeilBeforeNothingLetsTheBackgroundThrough) {
  Scene scene;
  add_wall(scene, 0, veil(0.25F, 2.0F));
  scene.background = {1.0F, 3.0F, 5.0F};
  finish_scene(scene);
  EXPECT_NEAR(seen(scene).g, 0.25 * 2.0 + 0.75 * 3.0, 1e-5);
}

TEST(Coverage, AVeilBehindAnOpaqueWallIsNotSeen) {
  Scene scene;
  add_wall(scene, 0, test::glowing(glm::vec3(8.0F)));
  add_wall(scene, -1, veil(0.5F, 2.0F));
  finish_scene(scene);
  EXPECT_EQ(seen(scene).g, 8.0F);
}

/// A wall that glows with 8 and two veils of 2 and 4 in its plane, each cut into triangles of its own, in this order.
Scene decals(bool wall_first) {
  Scene scene;
  const glm::dmat4 turned = glm::rotate(glm::dmat4(1.0), 0.7, glm::normalize(glm::dvec3(1.0, 2.0, 0.5)));
  const auto add = [&](const glm::vec3& corner, const glm::vec3& a, const glm::vec3& b, const Material& material) {
    place_mesh(scene, add_mesh(scene, quad(corner, a, b, add_material(scene, material))), turned);
  };
  const auto add_base = [&] { add({-50, -50, 0}, {100, 0, 0}, {0, 100, 0}, test::glowing(glm::vec3(8.0F))); };
  if (wall_first) add_base();
  add({-29, -41, 0}, {71, 13, 0}, {-11, 67, 0}, veil(0.5F, 2.0F));
  add({-37, -31, 0}, {59, -17, 0}, {19, 83, 0}, veil(0.5F, 4.0F));
  if (!wall_first) add_base();
  finish_scene(scene);
  return scene;
}

TEST(Coverage, VeilsInThePlaneOfAWallLieBeforeItAndAreMixedInOrder) {
  for (const bool wall_first : {true, false}) {
    const Scene scene = decals(wall_first);
    for (const glm::dvec3& eye : {glm::dvec3(3, 2, 9), glm::dvec3(8, -1, 2)}) {
      const View view = test::view_from(eye, {0, 0, 0}, {32, 32}, scene, 0.3);
      const TileLayer<Key> keys = opaque_keys(scene, view);
      TileLayer<Rgb> color(keys.layout());
      DeferredShader(scene, {}).shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &color});
      const Image<Rgb> image = to_image(color, 0);
      for (const Rgb& pixel : image.pixels()) ASSERT_NEAR(pixel.g, 4.0, 1e-5) << wall_first << eye.z;
    }
  }
}

TEST(Coverage, AMaskCoversAllOrNothingAtItsCutoff) {
  for (const float alpha : {0.49F, 0.5F, 0.51F}) {
    Scene scene;
    add_wall(scene, -5, test::glowing(glm::vec3(8.0F)));
    Material mask = veil(alpha, 2.0F);
    mask.alpha_mode = AlphaMode::Mask;
    add_wall(scene, 0, mask);
    finish_scene(scene);
    EXPECT_EQ(seen(scene).g, alpha < 0.5F ? 8.0F : 2.0F) << alpha;
  }
}

TEST(Coverage, AVeilCastsAShadowOfItsAlpha) {
  Scene scene;
  add_wall(scene, -5, test::diffuse());
  Material dark = veil(0.75F, 0.0F);
  const std::uint32_t index = add_material(scene, dark);
  place_mesh(scene, add_mesh(scene, quad({1, -50, -50}, {0, 0, 100}, {0, 100, 0}, index)));
  Light sun;
  sun.type = LightType::Directional;
  sun.direction = glm::normalize(glm::vec3(-1.0F, 0.0F, -1.0F));
  scene.lights = {sun};
  finish_scene(scene);
  const double full = std::cos(std::numbers::pi / 4.0) / std::numbers::pi;
  EXPECT_NEAR(seen(scene).g, 0.25 * full, 1e-4);
  EXPECT_NEAR(seen(scene, {.passes = {PassId::Reflection}}).g, full, 1e-4);
}

TEST(Coverage, AMirrorShowsAVeilByItsAlphaInTheMean) {
  Scene scene;
  add_wall(scene, 0, test::mirror(1.0F));
  add_wall(scene, 20, test::glowing(glm::vec3(8.0F)));
  add_wall(scene, 10, veil(0.25F, 2.0F));
  finish_scene(scene);
  const View view = test::view_from({0, 0, 5}, {0, 0, 0}, {1, 1}, scene, 1e-4);
  // cast_keys meets the mirror first: the veil is behind the eye.
  EXPECT_NEAR(test::mean_pixel(scene, view, 0, 0, 1024).g, 0.25 * 2.0 + 0.75 * 8.0, 0.02);
}

/// From z = 1 on, 2 mm apart, before the eye.
void add_layers(Scene& scene, int layers, const Material& material) {
  const std::uint32_t index = add_material(scene, material);
  const std::uint32_t mesh = add_mesh(scene, quad({-50, -50, 0}, {100, 0, 0}, {0, 100, 0}, index));
  for (int i = 0; i < layers; ++i) {
    glm::dmat4 to_world(1.0);
    to_world[3] = {0.0, 0.0, 1.0 + 0.002 * i, 1.0};
    place_mesh(scene, mesh, to_world);
  }
}

TEST(Coverage, LayersThatCoverNothingHideNothingHoweverMany) {
  for (const int layers : {100, 1500}) {
    Scene scene;
    Material leaf = test::glowing(glm::vec3(8.0F));
    leaf.alpha_mode = AlphaMode::Mask;
    add_wall(scene, 0, leaf);
    Material hole = veil(0.0F, 2.0F);
    hole.alpha_mode = AlphaMode::Mask;
    add_layers(scene, layers, hole);
    finish_scene(scene);
    RayCounts counts;
    EXPECT_EQ(seen_on_average(scene, {}, 1, &counts).g, 8.0) << layers;
    EXPECT_EQ(seen_on_average(scene, {.reference = true}, 1, &counts).g, 8.0) << layers;
    EXPECT_EQ(counts.cut, 0U);
  }
}

TEST(Coverage, TwoHundredThinVeilsAddUp) {
  Scene scene;
  add_layers(scene, 200, veil(0.02F, 1.0F));
  finish_scene(scene);
  const double expected = 1.0 - std::pow(0.98, 200);
  EXPECT_NEAR(seen(scene).g, expected, 1e-4);
  EXPECT_NEAR(seen_on_average(scene, {.reference = true}, 1024).g, expected, 0.02);
}

TEST(Coverage, TwoHundredThinVeilsCastAShadow) {
  Scene scene;
  add_wall(scene, 0, test::diffuse());
  Material dark = veil(0.02F, 0.0F);
  const std::uint32_t index = add_material(scene, dark);
  for (int i = 0; i < 200; ++i) {
    place_mesh(scene, add_mesh(scene, quad({1.0F + 0.005F * static_cast<float>(i), -50, -50}, {0, 0, 100}, {0, 100, 0},
                                           index)));
  }
  Light sun;
  sun.type = LightType::Directional;
  sun.direction = glm::normalize(glm::vec3(-1.0F, 0.0F, -1.0F));
  scene.lights = {sun};
  finish_scene(scene);
  const double expected = std::pow(0.98, 200) * std::cos(std::numbers::pi / 4.0) / std::numbers::pi;
  EXPECT_NEAR(seen(scene).g, expected, 1e-5);
  EXPECT_NEAR(seen(scene, {.reference = true}).g, expected, 1e-5);
}

TEST(Coverage, AMirrorShowsWhatTwoHundredVeilsLeave) {
  Scene scene;
  add_wall(scene, 0, test::mirror(1.0F));
  add_wall(scene, 20, test::glowing(glm::vec3(8.0F)));
  const std::uint32_t index = add_material(scene, veil(0.02F, 1.0F));
  for (int i = 0; i < 200; ++i) {
    place_mesh(scene, add_mesh(scene, quad({-50, -50, 10.0F + 0.005F * static_cast<float>(i)}, {100, 0, 0}, {0, 100, 0},
                                           index)));
  }
  finish_scene(scene);
  const double left = std::pow(0.98, 200);
  EXPECT_NEAR(seen_on_average(scene, {}, 1024).g, left * 8.0 + (1.0 - left), 0.15);
}

TEST(Coverage, WhereLayersAreTooManyItIsCountedAndSaidOnce) {
  Scene scene;
  add_layers(scene, 1200, veil(1e-4F, 0.0F));
  finish_scene(scene);
  for (const bool reference : {false, true}) {
    RayCounts counts;
    testing::internal::CaptureStderr();
    (void)seen_on_average(scene, {.reference = reference}, 3, &counts);
    const std::string said = testing::internal::GetCapturedStderr();
    EXPECT_GT(counts.cut, 0U) << reference;
    const std::size_t first = said.find("1000 surfaces");
    ASSERT_NE(first, std::string::npos) << said;
    EXPECT_EQ(said.find("1000 surfaces", first + 1), std::string::npos) << said;
  }
}

TEST(Coverage, SurfacesAreSortedByWhetherTheyCover) {
  Scene scene;
  add_wall(scene, 0, test::diffuse());
  add_wall(scene, 1, test::diffuse());
  add_wall(scene, 2, veil(0.5F, 1.0F));
  add_wall(scene, 3, test::diffuse());
  finish_scene(scene);
  EXPECT_EQ(covering_surfaces(scene, false), (std::vector<SurfaceRange>{{0, 4}, {6, 8}}));
  EXPECT_EQ(covering_surfaces(scene, true), (std::vector<SurfaceRange>{{4, 6}}));
}

}  // namespace
}  // namespace hpr
