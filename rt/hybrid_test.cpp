#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "rt/deferred_shader.h"
#include "rt/test_rooms.h"
#include "rt/test_scene.h"

// All passes together, held to the reference: light is neither lost between them nor counted twice.
namespace hpr {
namespace {

using test::add_material;
using test::add_mesh;
using test::mean_of;
using test::place_mesh;
using test::quad;
using test::room;

void expect_the_same_light(const Scene& scene, double glossy_cutoff = 0.3, bool terminator_fix = false,
                           const Scene* covering = nullptr, std::uint32_t samples = 64, bool gathers_too = false) {
  const View view = test::view_from({0, 0, 0.95}, {0, -0.25, -1}, {16, 16}, scene, 1.3);
  const glm::dvec3 reference =
      mean_of(scene, view,
              {.max_depth = 64, .glossy_cutoff = glossy_cutoff, .terminator_fix = terminator_fix, .reference = true},
              512, covering);
  for (const bool final_gather : {false, true}) {
    if (final_gather && !gathers_too) break;
    const glm::dvec3 hybrid = mean_of(scene, view,
                                      {.max_depth = 24,
                                       .glossy_cutoff = glossy_cutoff,
                                       .photons = final_gather ? 4'000U : 20'000U,
                                       .global_photons = true,
                                       .final_gather = final_gather,
                                       .terminator_fix = terminator_fix},
                                      samples, covering);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(hybrid[c] / reference[c], 1.0, 0.025) << "channel " << c << (final_gather ? ", gathered" : "");
    }
  }
}

TEST(Hybrid, AHeadlightShowsWhatIsLookedAtAndIsScatteredNoFurther) {
  for (const Material& thing : {test::mirror(0.9F), test::clear_glass(1.5F, 0.0F)}) {
    Scene scene = room(thing, false);
    for (Material& material : scene.materials) material.emissive = glm::vec3(0.0F);
    expect_the_same_light(scene);
  }
}

TEST(Hybrid, AMatteBall) {
  expect_the_same_light(room(test::diffuse({0.3F, 0.4F, 0.6F}), false));
}

/// Also where rays gather what photons tell.
void expect_the_same_light_however(const Scene& scene) {
  expect_the_same_light(scene, 0.3, false, nullptr, 64, true);
}

/// The lamp's back lights the ceiling it hangs under, where little of that comes out: wide discs of few photons would
/// spread it.
TEST(Hybrid, ALampCloseToTheCeilingWhereFewPhotonsAreGathered) {
  const Scene scene = room(test::diffuse({0.3F, 0.4F, 0.6F}), false);
  const View view = test::view_from({0, 0, 0.95}, {0, -0.25, -1}, {16, 16}, scene, 1.3);
  const glm::dvec3 reference = mean_of(scene, view, {.max_depth = 64, .terminator_fix = false, .reference = true}, 512);
  const RaySettings best{
      .max_depth = 24, .photons = 500, .global_photons = true, .final_gather = true, .terminator_fix = false};
  const glm::dvec3 hybrid = mean_of(scene, view, best, 128);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(hybrid[c] / reference[c], 1.0, 0.02) << "channel " << c;
}

/// The dark side of a wall that shades all it faces: what light it gets comes from a small panel that it does not see,
/// by way of the shaded floor.
Scene behind_a_wall() {
  Scene scene;
  const std::uint32_t grey = add_material(scene, test::diffuse(glm::vec3(0.4F)));
  const std::uint32_t white = add_material(scene, test::diffuse(glm::vec3(0.8F)));
  const std::uint32_t lamp = add_material(scene, test::glowing(glm::vec3(60.0F)));
  const auto side = [&](glm::vec3 corner, glm::vec3 a, glm::vec3 b, std::uint32_t material) {
    place_mesh(scene, add_mesh(scene, quad(corner, a, b, material)));
  };
  side({-4, 0, 4}, {8, 0, 0}, {0, 0, -8}, grey);
  side({0, 0, -4}, {0, 0, 8}, {0, 1.5F, 0}, grey);  // looks along -x
  side({0.01F, 0, 4}, {0, 0, -8}, {0, 1.5F, 0}, grey);
  side({0, 5, -0.5F}, {1, 0, 0}, {0, 0, 1}, white);
  side({0.7F, 1.4F, -0.3F}, {0.6F, 0, 0}, {0, 0, 0.6F}, lamp);
  finish_scene(scene);
  return scene;
}

/// Where few photons lie, a ray that gathers meets one so seldom that its pixel would shine among others.
TEST(Hybrid, DarkPlacesThatFewPhotonsReachHaveNoFireflies) {
  constexpr std::uint32_t kSamples = 64;
  const Scene scene = behind_a_wall();
  const View view = test::view_from({-3, 1.2, 0.5}, {0, 0.8, -0.2}, {16, 16}, scene, 0.3);
  const TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
  DeferredShader shader(scene, {.max_depth = 24,
                                .photons = 40'000,
                                .global_photons = true,
                                .final_gather = true,
                                .photon_footprint = 0.01,
                                .terminator_fix = false});
  std::vector<double> pixels(256, 0.0);
  for (std::uint32_t sample = 0; sample < kSamples; ++sample) {
    TileLayer<Rgb> radiance(keys.layout());
    shader.shade(std::span(&view, 1), keys, all_tiles(keys.layout()), {.radiance = &radiance}, {.sample = sample});
    for (int i = 0; i < 256; ++i) pixels[static_cast<std::size_t>(i)] += radiance.at(0, i % 16, i / 16).g;
  }
  const double mean = std::accumulate(pixels.begin(), pixels.end(), 0.0) / 256.0;
  double variance = 0.0;
  for (const double pixel : pixels) variance += (pixel - mean) * (pixel - mean) / 255.0;
  // 1.6 and 7.9 where all photons are looked up from as near.
  EXPECT_LT(std::sqrt(variance) / mean, 0.6);
  EXPECT_LT(*std::ranges::max_element(pixels) / mean, 5.0);
  // Of the path tracer's 60 000 samples; fewer are as noisy as paths to such places are.
  EXPECT_NEAR(mean / kSamples / 2.375e-4, 1.0, 4.0 * std::sqrt(variance / 256.0) / mean);
}

/// All light comes from a spot of the floor that is not seen.
TEST(Hybrid, AFloorWhoseNormalsLeanFromIt) {
  Scene scene = room(test::diffuse(glm::vec3(0.5F)), false);
  constexpr std::size_t kFloor = 4;
  scene.meshes[kFloor].normals.assign(4, glm::normalize(glm::vec3(1.5F, 1.0F, 0.0F)));
  for (Material& material : scene.materials) material.emissive = glm::vec3(0.0F);
  Light& spot = scene.lights.emplace_back();
  spot.type = LightType::Spot;
  spot.position = {0.6, 0.9, 0.6};
  spot.direction = {0.0F, -1.0F, 0.0F};
  spot.intensity = glm::vec3(20.0F);
  spot.inner_cone_radians = 0.1F;
  spot.outer_cone_radians = 0.18F;
  expect_the_same_light_however(scene);
}

TEST(Hybrid, AMirrorBall) {
  expect_the_same_light(room(test::mirror(0.9F), false));
}

TEST(Hybrid, APolishedMetalBallThatRaysFollow) {
  Material metal = test::mirror(0.9F);
  metal.roughness = 0.2F;
  expect_the_same_light_however(room(metal, false));
}

TEST(Hybrid, ARoughMetalBallThatPhotonsLight) {
  Material metal = test::mirror(0.9F);
  metal.roughness = 0.5F;
  expect_the_same_light(room(metal, false));
}

TEST(Hybrid, ARoughMetalBallThatRaysFollowAsSettingsSay) {
  Material metal = test::mirror(0.9F);
  metal.roughness = 0.5F;
  expect_the_same_light(room(metal, false), 1.0);
}

TEST(Hybrid, AMatteBallBetweenFacingMirrors) {
  Scene scene = room(test::diffuse({0.3F, 0.4F, 0.6F}), false);
  const std::uint32_t mirror = add_material(scene, test::mirror(0.95F));
  for (const std::size_t wall : {std::size_t{2}, std::size_t{3}}) scene.meshes[wall].material = mirror;
  finish_scene(scene);
  expect_the_same_light_however(scene);
}

TEST(Hybrid, ALacqueredFloor) {
  Scene scene = room(test::diffuse({0.3F, 0.4F, 0.6F}), false);
  constexpr std::size_t kFloor = 4;
  Material lacquer = test::diffuse(glm::vec3(0.6F));
  lacquer.ior = 1.5F;
  lacquer.roughness = 0.05F;
  scene.meshes[kFloor].material = add_material(scene, lacquer);
  finish_scene(scene);
  expect_the_same_light_however(scene);
}

TEST(Hybrid, AGlassBall) {
  expect_the_same_light_however(room(test::clear_glass(1.5F, 1.0F), false));
}

/// Mostly coloured by its base, and light goes through and through it.
Material half_glass(float roughness) {
  Material material = test::clear_glass(1.5F, 1.0F);
  material.transmission = 0.5F;
  material.base_color = glm::vec4(0.9F, 0.9F, 0.9F, 1.0F);
  material.roughness = roughness;
  return material;
}

TEST(Hybrid, ABallOfHalfGlass) {
  expect_the_same_light(room(half_glass(0.0F), false));
}

TEST(Hybrid, ABallOfHalfGlassInAFurnaceGivesBackNoMoreThanArrives) {
  for (const float roughness : {0.0F, 0.4F}) test::expect_no_more_than_arrives(roughness, 16);
}

TEST(Hybrid, AClearSheet) {
  expect_the_same_light(room(test::clear_glass(1.5F, 0.0F), true));
}

TEST(Hybrid, AFrostedSheet) {
  Material sheet = test::clear_glass(1.5F, 0.0F);
  sheet.roughness = 0.6F;
  expect_the_same_light(room(sheet, true));
}

TEST(Hybrid, AFrostedSheetBeforeAPointOfLight) {
  Material sheet = test::clear_glass(1.5F, 0.0F);
  sheet.roughness = 0.6F;
  Scene scene = room(sheet, true);
  for (Material& material : scene.materials) material.emissive = glm::vec3(0.0F);
  Light& light = scene.lights.emplace_back();
  light.type = LightType::Point;
  light.position = {0.1, -0.3, -0.5};
  light.intensity = glm::vec3(1.0F);
  expect_the_same_light_however(scene);
}

TEST(Hybrid, ACoarseShellOfFrostedGlassAboutALampWhoseShadowRaysAreLifted) {
  Scene scene;
  Material frosted = test::clear_glass(1.5F, 0.0F);
  frosted.roughness = 0.6F;
  place_mesh(scene, add_mesh(scene, test::sphere(0.6, 6, add_material(scene, frosted))),
             glm::dmat4(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -0.3, -0.5, 1));
  scene.lights.emplace_back().position = {0.1, -0.3, -0.5};
  finish_scene(scene);
  expect_the_same_light(scene, 0.3, true);
}

/// A ball on a floor under a sky of clouds, one far brighter than the others.
Scene under_the_sky(const Material& thing) {
  Scene scene;
  const std::uint32_t ground = add_material(scene, test::diffuse({0.6F, 0.5F, 0.4F}));
  place_mesh(scene, add_mesh(scene, quad({-2, -1, -2}, {0, 0, 4}, {4, 0, 0}, ground)));
  place_mesh(scene, add_mesh(scene, test::sphere(0.45, 64, add_material(scene, thing))),
             glm::dmat4(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -0.5, 0, 1));
  scene.environment = Environment{Image<Rgb>({8, 4}, {0.5F, 0.6F, 0.9F})};
  scene.environment->image.at(2, 1) = {6.0F, 5.0F, 4.0F};
  for (int x = 0; x < 8; x += 3) scene.environment->image.at(x, 0) = {1.0F, 0.8F, 0.7F};
  finish_scene(scene);
  return scene;
}

TEST(Hybrid, AMatteBallUnderTheSky) {
  expect_the_same_light(under_the_sky(test::diffuse({0.3F, 0.4F, 0.6F})));
}

TEST(Hybrid, APolishedMetalBallUnderTheSky) {
  Material metal = test::mirror(0.9F);
  metal.roughness = 0.25F;
  expect_the_same_light(under_the_sky(metal));
}

TEST(Hybrid, AFrostedGlassBallUnderTheSky) {
  Material glass = test::clear_glass(1.5F, 1.0F);
  glass.roughness = 0.4F;
  expect_the_same_light(under_the_sky(glass), 0.3, false, nullptr, 256);
}

TEST(Hybrid, ABallBeforeASphereOfLightASpotAndASun) {
  Scene scene = under_the_sky(test::diffuse({0.3F, 0.4F, 0.6F}));
  scene.environment.reset();
  for (const LightType type : {LightType::Point, LightType::Spot, LightType::Directional}) {
    Light& light = scene.lights.emplace_back();
    light.type = type;
    light.position = type == LightType::Point ? glm::dvec3(0.9, 0.4, 0.5) : glm::dvec3(-0.8, 1.0, 0.3);
    light.radius = type == LightType::Point ? 0.2 : 0.0;
    light.direction = glm::normalize(glm::vec3(0.5F, -1.0F, -0.2F));
    light.angular_radius_radians = 0.05F;
    light.inner_cone_radians = 0.3F;
    light.outer_cone_radians = 0.6F;
  }
  expect_the_same_light(scene);
}

/// A wall of light that is none, behind a floor of some material. The lamp is far weaker.
Scene beside_an_unlit_wall(const Material& floor) {
  Scene scene;
  place_mesh(scene, add_mesh(scene, quad({-2, -1, 0}, {4, 0, 0}, {0, 0, -2}, add_material(scene, floor))));
  Material poster = test::diffuse({2.0F, 1.0F, 0.5F});
  poster.unlit = true;
  place_mesh(scene, add_mesh(scene, quad({-2, -1, -2}, {4, 0, 0}, {0, 3, 0}, add_material(scene, poster))));
  Light& light = scene.lights.emplace_back();
  light.position = {0.3, 0.8, -0.5};
  light.intensity = glm::vec3(0.2F);
  finish_scene(scene);
  return scene;
}

TEST(Hybrid, AMatteFloorBesideAnUnlitWall) {
  expect_the_same_light(beside_an_unlit_wall(test::diffuse({0.8F, 0.8F, 0.8F})));
}

TEST(Hybrid, WhatAnUnlitWallIsSaidToEmitIsNoLight) {
  Scene scene = beside_an_unlit_wall(test::diffuse({0.8F, 0.8F, 0.8F}));
  const View view = test::view_from({0, 0, 0.95}, {0, -0.25, -1}, {16, 16}, scene, 1.3);
  for (const bool reference : {false, true}) {
    const RaySettings settings{.photons = 1000, .global_photons = true, .reference = reference};
    for (Material& material : scene.materials) material.emissive = glm::vec3(0.0F);
    const glm::dvec3 dark = mean_of(scene, view, settings, 4);
    scene.materials[1].emissive = glm::vec3(5.0F);
    EXPECT_EQ(mean_of(scene, view, settings, 4), dark) << reference;
  }
}

TEST(Hybrid, AMirrorBesideAnUnlitWall) {
  expect_the_same_light(beside_an_unlit_wall(test::mirror(0.9F)));
}

TEST(Hybrid, AMetalFloorBesideAnUnlitWall) {
  for (const float roughness : {0.2F, 0.5F}) {
    Material metal = test::mirror(0.9F);
    metal.roughness = roughness;
    expect_the_same_light(beside_an_unlit_wall(metal));
  }
  Material metal = test::mirror(0.9F);
  metal.roughness = 0.5F;
  expect_the_same_light(beside_an_unlit_wall(metal), 1.0);
}

TEST(Hybrid, APolishedFloorBesideAnUnlitWall) {
  Material plastic = test::diffuse({0.8F, 0.8F, 0.8F});
  plastic.ior = 1.5F;
  plastic.roughness = 0.2F;
  expect_the_same_light_however(beside_an_unlit_wall(plastic));
}

TEST(Hybrid, AFrostedSheetBeforeAnUnlitWall) {
  Scene scene = beside_an_unlit_wall(test::diffuse({0.8F, 0.8F, 0.8F}));
  Material sheet = test::clear_glass(1.5F, 0.0F);
  sheet.roughness = 0.4F;
  place_mesh(scene,
             add_mesh(scene, quad({-0.6F, -0.9F, 0.1F}, {1.2F, 0, 0}, {0, 1.2F, 0.2F}, add_material(scene, sheet))));
  finish_scene(scene);
  expect_the_same_light(scene);
}

/// The room with its last thing covering `alpha` of what is behind.
void expect_the_same_light_behind(Scene scene, double alpha) {
  Scene covering = scene;
  covering.instances.pop_back();
  finish_scene(covering);
  scene.materials.back().alpha_mode = AlphaMode::Blend;
  scene.materials.back().base_color.a = static_cast<float>(alpha);
  expect_the_same_light(scene, 0.3, false, &covering);
}

TEST(Hybrid, ASheetThatCoversInPart) {
  for (const double alpha : {0.5, 0.1})
    expect_the_same_light_behind(room(test::diffuse({0.8F, 0.8F, 0.2F}), true), alpha);
}

TEST(Hybrid, ADecalCloseToTheFloor) {
  Scene scene = room(test::diffuse({0.8F, 0.8F, 0.2F}), true);
  scene.instances.pop_back();
  place_mesh(scene, add_mesh(scene, quad({-0.9F, -0.999F, 0.9F}, {1.8F, 0, 0}, {0, 0, -1.8F},
                                         static_cast<std::uint32_t>(scene.materials.size() - 1))));
  finish_scene(scene);
  expect_the_same_light_behind(std::move(scene), 0.5);
}

/// A black sheet that covers half, and close behind it, or at its very place, a wall that glows. `sheet_first`: of the
/// two the sheet has the lower ids.
Scene veiled_glow(double gap, bool sheet_first) {
  Scene scene;
  Material sheet = test::diffuse(glm::vec3(0.0F));
  sheet.alpha_mode = AlphaMode::Blend;
  sheet.base_color.a = 0.5F;
  const std::uint32_t veil = add_material(scene, sheet);
  const std::uint32_t glow = add_material(scene, test::glowing(glm::vec3(1.0F)));
  const auto wall = [&](double z, std::uint32_t material) {
    place_mesh(scene, add_mesh(scene, quad({-2, -2, static_cast<float>(z)}, {4, 0, 0}, {0, 4, 0}, material)));
  };
  if (sheet_first) wall(gap, veil);
  wall(0.0, glow);
  if (!sheet_first) wall(gap, veil);
  finish_scene(scene);
  return scene;
}

TEST(Hybrid, NothingIsSkippedBehindASheetThatLiesOnIt) {
  for (const double gap : {0.0, 1e-7, 1e-6, 1e-3}) {
    for (const bool sheet_first : {false, true}) {
      if (gap < 1e-6 && !sheet_first) continue;  // at one distance the wall, being first, hides the sheet
      const Scene scene = veiled_glow(gap, sheet_first);
      const View view = test::view_from({0, 0, 2}, {0, 0, 0}, {16, 16}, scene, 0.5);
      const glm::dvec3 reference = mean_of(scene, view, {.reference = true}, 64);
      EXPECT_NEAR(reference.g, 0.5, 0.02) << gap << ' ' << sheet_first;  // 4 sigma: 0.0156
    }
  }
}

TEST(Hybrid, APaneOfOneMeshWhoseFacesLieCloseTogether) {
  Scene scene = room(test::diffuse({0.8F, 0.8F, 0.2F}), true);
  scene.instances.pop_back();
  const auto material = static_cast<std::uint32_t>(scene.materials.size() - 1);
  Mesh pane = quad({-0.9F, -0.8F, 0.9F}, {1.8F, 0, 0}, {0, 0, -1.8F}, material);
  const Mesh below = quad({-0.9F, -0.805F, 0.9F}, {0, 0, -1.8F}, {1.8F, 0, 0}, material);
  pane.positions.insert(pane.positions.end(), below.positions.begin(), below.positions.end());
  pane.uvs[0].insert(pane.uvs[0].end(), below.uvs[0].begin(), below.uvs[0].end());
  for (const glm::uvec3& corners : below.triangles) pane.triangles.push_back(corners + glm::uvec3(4));
  place_mesh(scene, add_mesh(scene, pane));
  finish_scene(scene);
  expect_the_same_light_behind(std::move(scene), 0.5);
}

TEST(Hybrid, AVeil) {
  Material veil = test::diffuse({0.8F, 0.8F, 0.2F});
  veil.alpha_mode = AlphaMode::Mask;  // cast_keys has no coverage: a mask that covers all, but by way of coverage
  expect_the_same_light(room(veil, true));
}

}  // namespace
}  // namespace hpr
