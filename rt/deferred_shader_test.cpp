#include "rt/deferred_shader.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <numbers>
#include <optional>
#include <random>

#include "rt/test_rooms.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

using test::add_material;
using test::add_mesh;
using test::place_mesh;
using test::quad;
using test::white_floor;

Light point_light(const glm::dvec3& position, float intensity) {
  Light light;
  light.position = position;
  light.intensity = glm::vec3(intensity);
  return light;
}

TEST(DeferredShader, APointLightOverAWhitePlaneGivesTheAnalyticRadiance) {
  test::expect_light_of_a_point();
}

TEST(DeferredShader, ABlockersShadowEndsWhereGeometrySays) {
  Scene scene = white_floor();
  // A square of half side 0.5 at half the light's height: its shadow has half side 1.
  place_mesh(scene, add_mesh(scene, quad({-0.5, 1, 0.5}, {1, 0, 0}, {0, 0, -1}, 0)));
  finish_scene(scene);
  scene.lights = {point_light({0, 2, 0}, 1.0F)};
  const View view = test::view_from({0.0, 0.9, 3.9}, {0, 0, 0}, {80, 60}, scene);
  const TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
  const test::Shaded lit = test::shade(scene, view);
  const test::Shaded unshadowed = test::shade(scene, view, {.auto_passes = false});
  int dark = 0;
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 80; ++x) {
      const Key key = keys.at(0, x, y);
      if (key == kNoKey || key_surface(key) >= 2) continue;
      const Ray ray = view_ray(view, x + 0.5, y + 0.5);
      const glm::dvec3 p = ray.origin - ray.direction * (ray.origin.y / ray.direction.y);
      const double edge = std::max(std::abs(p.x), std::abs(p.z)) - 1.0;
      EXPECT_GT(unshadowed.image.at(x, y).r, 0.0F);
      if (std::abs(edge) < 1e-5) continue;
      ASSERT_EQ(lit.image.at(x, y).r == 0.0F, edge < 0.0) << x << ',' << y;
      dark += edge < 0.0 ? 1 : 0;
    }
  }
  EXPECT_GT(dark, 20);
  EXPECT_EQ(unshadowed.counts[PassId::Shadow], 0U);
}

TEST(DeferredShader, ALightThatLiesOnASurfaceIsNotHiddenByIt) {
  Scene scene = white_floor();
  add_mesh(scene, quad({-4, 3, -4}, {8, 0, 0}, {0, 0, 8}, 0));
  place_mesh(scene, 1);
  finish_scene(scene);
  scene.lights = {point_light({0.1, 3.0, 0.2}, 1.0F)};
  const View view = test::view_from({0, 1, 0.1}, {0, 0, 0}, {32, 32}, scene);
  const test::Shaded lit = test::shade(scene, view);
  for (const Rgb& pixel : lit.image.pixels()) EXPECT_GT(pixel.r, 0.0F);
}

TEST(DeferredShader, ALightNearerThanRoundingCastsNoImpossibleRay) {
  Scene scene = white_floor();
  // Where rays of this floor start: 4 * 2^-23 of 4 + 8 metres above it.
  scene.lights = {point_light({0, 5.7e-6, 0}, 1e-10F)};
  const test::Shaded lit = test::shade(scene, test::view_from({0, 3, 0}, {0, 0, 0}, {3, 3}, scene, 1e-4, {0, 0, -1}));
  EXPECT_GT(lit.counts[PassId::Shadow], 0U);
  EXPECT_EQ(lit.counts.invalid, 0U);
  EXPECT_GT(lit.image.at(1, 1).r, 0.0F);
}

TEST(DeferredShader, NoSphereShadowsItselfAtAnyScale) {
  for (const double scale : {1e-9, 1e-3, 1.0, 1e3, 1e9}) {
    for (const double offset : {0.0, 100.0}) test::expect_no_shadow_on_itself(scale, offset);
  }
}

Scene busy_scene(bool flattened) {
  Scene scene;
  add_material(scene, test::diffuse({0.8F, 0.7F, 0.6F}));
  Material shiny;
  shiny.base_color = {0.9F, 0.8F, 0.5F, 1.0F};
  shiny.roughness = 0.15F;
  add_material(scene, shiny);
  place_mesh(scene, add_mesh(scene, quad({-3, -1, 3}, {6, 0, 0}, {0, 0, -6}, 0)));
  const Mesh ball = test::sphere(0.6, 10, 1);
  const std::uint32_t shared = flattened ? 0 : add_mesh(scene, ball);
  for (int i = 0; i < 4; ++i) {
    glm::dmat4 to_world = glm::translate(glm::dmat4(1.0), {1.3 * i - 2.0, 0.1 * i - 0.3, -0.4 * i});
    to_world = glm::rotate(to_world, 0.7 * i, glm::normalize(glm::dvec3(1, 2, 3)));
    to_world = glm::scale(to_world, {1.0, i == 2 ? -0.7 : 1.0, 1.0 + 0.2 * i});
    if (!flattened) {
      place_mesh(scene, shared, to_world);
      continue;
    }
    Mesh moved = ball;
    const glm::dmat3 normal_matrix = glm::transpose(glm::inverse(glm::dmat3(to_world)));
    for (glm::vec3& p : moved.positions) p = glm::vec3(to_world * glm::dvec4(p, 1.0));
    for (glm::vec3& n : moved.normals) n = glm::vec3(glm::normalize(normal_matrix * glm::dvec3(n)));
    place_mesh(scene, add_mesh(scene, moved));
  }
  finish_scene(scene);
  scene.lights = {point_light({2, 4, 3}, 40.0F), point_light({-3, 3, 1}, 20.0F)};
  scene.background = {0.1F, 0.2F, 0.4F};
  return scene;
}

TEST(DeferredShader, InstancedAndFlattenedScenesLookTheSame) {
  const Scene instanced = busy_scene(false);
  const View view = test::view_from({0.3, 1.5, 6}, {0, -0.2, 0}, {96, 64}, instanced, 0.7);
  const TileLayer<Key> keys = test::cast_keys(instanced, std::span(&view, 1));
  const std::vector<std::size_t> tiles = all_tiles(keys.layout());
  TileLayer<Rgb> a(keys.layout());
  TileLayer<Rgb> b(keys.layout());
  const Scene flattened = busy_scene(true);
  DeferredShader(instanced, {}).shade(std::span(&view, 1), keys, tiles, {.radiance = &a});
  DeferredShader(flattened, {}).shade(std::span(&view, 1), keys, tiles, {.radiance = &b});
  int differing = 0;
  for (const std::size_t tile : tiles) {
    for (std::size_t i = 0; i < kTilePixels; ++i) {
      const Rgb& p = a.tile(tile)[i];
      const Rgb& q = b.tile(tile)[i];
      differing += std::abs(p.r - q.r) + std::abs(p.g - q.g) + std::abs(p.b - q.b) > 1e-5F * (1.0F + p.r) ? 1 : 0;
    }
  }
  // Vertices are rounded to float in one of them: a ray at a silhouette or a shadow's edge may fall on its other side,
  // and so may those that go on from mirrors.
  EXPECT_LE(differing, 6);
}

TEST(DeferredShader, ThreadsAndTileListsChangeNoBit) {
  const Scene scene = busy_scene(false);
  const View left = test::view_from({0.3, 1.5, 6}, {0, -0.2, 0}, {150, 130}, scene, 0.7);
  const View right = test::view_from({3.3, 1.5, 6}, {0, -0.2, 0}, {70, 64}, scene, 0.7);
  const std::vector<View> views{left, right};
  const TileLayer<Key> keys = test::cast_keys(scene, views);
  const std::vector<std::size_t> tiles = all_tiles(keys.layout());
  TileLayer<Rgb> whole(keys.layout());
  TileLayer<Rgb> threaded(keys.layout());
  TileLayer<Rgb> split(keys.layout());
  DeferredShader one(scene, {.threads = 1});
  one.shade(views, keys, tiles, {.radiance = &whole});
  const RayCounts counts = one.counts();
  EXPECT_GT(counts[PassId::Reflection], 100U);
  EXPECT_GT(counts[PassId::Shadow], 100U);
  DeferredShader two(scene, {.threads = 2});
  two.shade(views, keys, tiles, {.radiance = &threaded});
  EXPECT_EQ(two.counts(), counts);
  RayCounts summed;
  for (auto tile = tiles.rbegin(); tile != tiles.rend(); ++tile) {
    one.shade(views, keys, std::span(&*tile, 1), {.radiance = &split});
    summed += one.counts();
  }
  EXPECT_EQ(summed, counts);
  for (const std::size_t tile : tiles) {
    EXPECT_TRUE(std::ranges::equal(whole.tile(tile), threaded.tile(tile))) << tile;
    EXPECT_TRUE(std::ranges::equal(whole.tile(tile), split.tile(tile))) << tile;
  }
}

TEST(DeferredShader, APixelDoesNotDependOnItsNeighbours) {
  const Scene scene = busy_scene(false);
  const View view = test::view_from({0.3, 1.5, 6}, {0, -0.2, 0}, {64, 64}, scene, 0.7);
  const TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
  TileLayer<Key> sparse(keys.layout());
  std::mt19937 random(5);
  for (std::size_t i = 0; i < kTilePixels; ++i) {
    if (random() % 3 == 0) sparse.tile(0)[i] = keys.tile(0)[i];
  }
  sparse.set_active(0);
  const std::vector<std::size_t> tiles{0};
  TileLayer<Rgb> all(keys.layout());
  TileLayer<Rgb> some(keys.layout());
  DeferredShader shader(scene, {});
  shader.shade(std::span(&view, 1), keys, tiles, {.radiance = &all});
  shader.shade(std::span(&view, 1), sparse, tiles, {.radiance = &some});
  for (std::size_t i = 0; i < kTilePixels; ++i) {
    if (sparse.tile(0)[i] != kNoKey) {
      ASSERT_EQ(all.tile(0)[i], some.tile(0)[i]) << i;
    }
  }
}

TEST(DeferredShader, ScalingTheWholeSceneByAPowerOfTwoScalesNothingButTheLight) {
  const auto picture = [](double scale) {
    Scene scene = busy_scene(false);
    for (Instance& instance : scene.instances) {
      instance.to_world = glm::scale(glm::dmat4(1.0), glm::dvec3(scale)) * instance.to_world;
    }
    for (Light& light : scene.lights) {
      light.position *= scale;
      light.intensity *= static_cast<float>(scale * scale);
    }
    finish_scene(scene);
    const View view = test::view_from(scale * glm::dvec3(0.3, 1.5, 6), {0, -0.2 * scale, 0}, {64, 48}, scene, 0.7);
    return test::shade(scene, view).image;
  };
  const Image<Rgb> base = picture(1.0);
  EXPECT_TRUE(base == picture(std::ldexp(1.0, 20)));
  EXPECT_TRUE(base == picture(std::ldexp(1.0, -20)));
}

TEST(DeferredShader, AnEmptySceneIsItsBackground) {
  Scene scene;
  scene.background = {1.0F, 2.0F, 3.0F};
  finish_scene(scene);
  const View view = test::view_from({0, 0, 3}, {0, 0, 0}, {10, 7}, scene);
  const test::Shaded lit = test::shade(scene, view);
  for (const Rgb& pixel : lit.image.pixels()) EXPECT_EQ(pixel, (Rgb{1.0F, 2.0F, 3.0F}));
}

TEST(DeferredShader, InfiniteRadianceIsBlackAndCounted) {
  Scene scene = white_floor();
  scene.materials[0].emissive = glm::vec3(3e38F);
  scene.materials[0].base_color = glm::vec4(1.0F);
  scene.lights = {point_light({0, 1e-30, 0}, 3e38F), point_light({0, 1, 0}, 3e38F), point_light({0, 1, 0}, 3e38F)};
  const View view = test::view_from({0, 0.5, 0.1}, {0, 0, 0}, {9, 9}, scene);
  const test::Shaded lit = test::shade(scene, view);
  for (const Rgb& pixel : lit.image.pixels()) EXPECT_TRUE(std::isfinite(pixel.r));
  EXPECT_GT(lit.counts.not_finite, 0U);
}

/// The counts of screens side by side that see an infinitely bright background from the right one's eleventh column on.
RayCounts counts_of_too_bright(bool are_joined, bool by_paths) {
  Scene scene;
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-3.79F, -2, 0}, {4, 0, 0}, {0, 4, 0}, 0)));
  Material unlit;
  unlit.unlit = true;
  test::add_material(scene, unlit);
  constexpr float kInfinite = std::numeric_limits<float>::infinity();
  scene.background = {kInfinite, kInfinite, kInfinite};
  finish_scene(scene);
  View left = test::view_from({0, 0, 3}, {0, 0, 0}, {70, 100}, scene);
  left.right = 0.0;
  left.left = -0.007 * left.screen.width;
  View right = left;
  left.screen_number = 5;
  right.screen_number = 6;
  right.left = 0.0;
  right.right = -left.left;
  std::vector<View> views{left, right};
  if (are_joined) {
    views = join_screens(views);
    // What enlarging takes.
    ++views[0].block.x1;
    --views[1].block.x0;
  }
  const TileLayer<Key> keys = test::cast_keys(scene, views);
  RaySettings settings;
  settings.reference = by_paths;
  DeferredShader shader(scene, settings);
  TileLayer<Rgb> radiance(keys.layout());
  shader.shade(views, keys, all_tiles(keys.layout()), {.radiance = &radiance});
  return shader.counts();
}

TEST(DeferredShader, PixelsWithoutFiniteRadianceAreThoseOfTheirScreenThoughItIsJoined) {
  for (const bool by_paths : {false, true}) {
    const RayCounts alone = counts_of_too_bright(false, by_paths);
    const RayCounts joined = counts_of_too_bright(true, by_paths);
    EXPECT_GT(alone.not_finite, 100U);
    EXPECT_EQ(alone.first_not_finite.screen, 6U);
    EXPECT_EQ(joined.not_finite, alone.not_finite);
    EXPECT_EQ(joined.first_not_finite, alone.first_not_finite);
  }
}

TEST(DeferredShader, TheFirstPixelWithoutFiniteRadianceIsNamedWhoeverMeetsIt) {
  Scene scene;
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0)));
  Material bright = test::glowing(glm::vec3(3e38F));
  bright.base_color = glm::vec4(1.0F);
  test::add_material(scene, bright);
  finish_scene(scene);
  scene.lights = {point_light({0, 0, 1}, 3e38F), point_light({0, 0, 1}, 3e38F)};
  View view = test::view_from({0, 0, 3}, {0, 0, 0}, {150, 150}, scene);
  view.screen_number = 3;
  view.screen = {1000, 1000};
  view.block = {400, 300, 550, 450};
  const TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
  std::vector<std::size_t> tiles = all_tiles(keys.layout());
  std::optional<RayCounts> expected;
  for (const int threads : {1, 3}) {
    RaySettings settings;
    settings.threads = threads;
    DeferredShader shader(scene, settings);
    TileLayer<Rgb> radiance(keys.layout());
    shader.shade(std::span(&view, 1), keys, tiles, {.radiance = &radiance});
    const RayCounts counts = shader.counts();
    ASSERT_GT(counts.not_finite, 1U);
    EXPECT_EQ(expected.value_or(counts), counts);
    expected = counts;
    EXPECT_EQ(counts.first_not_finite.screen, 3U);
    EXPECT_GE(counts.first_not_finite.x, 400);
    EXPECT_GE(counts.first_not_finite.y, 300);
    std::ranges::reverse(tiles);
  }
  // Two ranks with half the tiles each add up to the same.
  RayCounts sum;
  for (std::size_t part = 0; part < 2; ++part) {
    DeferredShader shader(scene, {});
    TileLayer<Rgb> radiance(keys.layout());
    const std::size_t half = tiles.size() / 2;
    const auto mine = std::span(tiles).subspan(part * half, part == 0 ? half : tiles.size() - half);
    shader.shade(std::span(&view, 1), keys, mine, {.radiance = &radiance});
    sum += shader.counts();
  }
  EXPECT_EQ(sum.first_not_finite, expected->first_not_finite);
  EXPECT_EQ(sum.not_finite, expected->not_finite);
  EXPECT_LT(sum.first_not_finite, kNoPixel);
}

TEST(DeferredShader, LocalShadingPutsTheDisplayColourIntoTheKeys) {
  const Scene scene = busy_scene(false);
  const View view = test::view_from({0.3, 1.5, 6}, {0, -0.2, 0}, {64, 64}, scene, 0.7);
  TileLayer<Key> keys = test::cast_keys(scene, std::span(&view, 1));
  const std::vector<Key> before(keys.tile(0).begin(), keys.tile(0).end());
  const std::vector<std::size_t> tiles{0};
  TileLayer<Rgb> radiance(keys.layout());
  DeferredShader shader(scene, {});
  shader.shade(std::span(&view, 1), keys, tiles, {.radiance = &radiance});
  shade_local(shader, std::span(&view, 1), keys, tiles);
  for (std::size_t i = 0; i < kTilePixels; ++i) {
    if (before[i] == kNoKey) {
      ASSERT_EQ(keys.tile(0)[i], kNoKey);
    } else {
      ASSERT_EQ(key_depth(keys.tile(0)[i]), key_depth(before[i]));
      ASSERT_EQ(from_word(key_rgba(keys.tile(0)[i])), to_srgb(radiance.tile(0)[i]));
    }
  }
}

// A flat floor whose normals pretend a hill, higher than the wall that stands on it: lifted rays look over the wall.
TEST(DeferredShader, TheReferenceLiftsShadowRaysAsSettingsSay) {
  Scene scene;
  const std::uint32_t white = add_material(scene, test::diffuse());
  Mesh hill = quad({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, white);
  for (const glm::vec3& corner : hill.positions) {
    hill.normals.push_back(glm::normalize(glm::vec3(0.5F * corner.x, 1.0F, 0.5F * corner.z)));
  }
  place_mesh(scene, add_mesh(scene, hill));
  place_mesh(scene, add_mesh(scene, quad({0, 0, 1}, {0, 0.1F, 0}, {0, 0, -2}, white)));
  Light& sun = scene.lights.emplace_back();
  sun.type = LightType::Directional;
  sun.direction = glm::normalize(glm::vec3(-1.0F, -0.2F, 0.0F));
  finish_scene(scene);
  const View view = test::view_from({-0.5, 4, 0}, {-0.5, 0, 0}, {32, 32}, scene, 0.3, {1.0, 0.0, 0.0});
  const auto sum = [&](bool fix) {
    const Image<Rgb> image = test::shade(scene, view, {.terminator_fix = fix, .reference = true}).image;
    double total = 0.0;
    for (int y = 0; y < 32; ++y) {
      for (int x = 0; x < 32; ++x) total += image.at(x, y).g;
    }
    return total;
  };
  EXPECT_GT(sum(true), 1.1 * sum(false));
}

/// What the ground shows a centimetre under a roof that hides a lamp, or, without a roof, in its light; all of it
/// turned.
double seen_on_ground(double half_size, bool has_roof, const glm::dvec3& lamp, const RaySettings& settings,
                      const glm::dmat4& turned) {
  Scene scene;
  const auto size = static_cast<float>(half_size);
  test::add_material(scene, test::diffuse());
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-size, 0, -size}, {0, 0, 2 * size}, {2 * size, 0, 0}, 0)),
                   turned);
  if (has_roof) {
    test::place_mesh(scene, test::add_mesh(scene, test::quad({-1, 0.01F, -1}, {0, 0, 2}, {2, 0, 0}, 0)), turned);
  }
  const auto in_world = [&](const glm::dvec3& at) { return glm::dvec3(turned * glm::dvec4(at, 1.0)); };
  Light light;
  light.position = in_world(lamp);
  scene.lights = {light};
  finish_scene(scene);
  const View view =
      test::view_from(in_world({0.1, 0.006, 0.2}), in_world({0.1, 0, 0.2}), {3, 3}, scene, 0.5, in_world({1, 0, 0}));
  return test::mean(test::shade(scene, view, settings).image);
}

TEST(DeferredShader, ContactShadowsStayHoweverWideTheGroundIs) {
  const glm::dmat4 level(1.0);
  const glm::dmat4 tilted = glm::rotate(glm::rotate(level, 0.5, glm::dvec3(0, 0, 1)), 0.35, glm::dvec3(1, 0, 0));
  for (const RaySettings& settings :
       {RaySettings{.passes = {PassId::Shadow}}, RaySettings{.max_depth = 2, .reference = true}}) {
    for (const double half_size : {10.0, 1e3, 1e6}) {
      // High above, and close above the roof: neither end of a shadow ray lies past it.
      for (const glm::dvec3& lamp : {glm::dvec3(2, 3, 1), glm::dvec3(0.1, 0.05, 0.2)}) {
        for (const glm::dmat4& turned : {level, tilted}) {
          EXPECT_EQ(seen_on_ground(half_size, true, lamp, settings, turned), 0.0) << half_size << ' ' << lamp.y;
          EXPECT_GT(seen_on_ground(half_size, false, lamp, settings, turned), 0.01) << half_size << ' ' << lamp.y;
        }
      }
    }
  }
}

}  // namespace
}  // namespace hpr
