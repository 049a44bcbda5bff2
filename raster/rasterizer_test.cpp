#include "raster/rasterizer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "core/error.h"
#include "raster/chunk_bounds.h"
#include "raster/gl.h"
#include "raster/raster_test_scenes.h"
#include "scene/generators/generators.h"
#include "scene/gltf/gltf.h"
#include "scene/gltf/test_tools.h"

namespace hpr {
namespace {

using namespace test;

class RasterizerTest : public testing::TestWithParam<std::string> {
 protected:
  std::unique_ptr<GlContext> context_ = make_gl_context({.backend = GetParam()});
};

INSTANTIATE_TEST_SUITE_P(Backends, RasterizerTest, testing::ValuesIn(all_gl_backends()),
                         [](const auto& each) { return each.param; });

/// Two triangles that span [-half, half]^2 at z = 0.
Mesh quad(float half) {
  Mesh mesh;
  mesh.positions = {{-half, -half, 0.0F}, {half, -half, 0.0F}, {half, half, 0.0F}, {-half, half, 0.0F}};
  mesh.normals.assign(4, {0.0F, 0.0F, 1.0F});
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

Scene quad_scene(float half, const glm::dvec3& at) {
  Scene scene;
  scene.meshes = {quad(half)};
  scene.instances = {placed(0, at)};
  finish_scene(scene);
  return scene;
}

TEST_P(RasterizerTest, AQuadCoversTheRightPixelsAtTheRightDepth) {
  // 4 m away, 1 m wide: a quarter of a screen whose edges lie at +-0.5 on the plane at 1 m; shifted one pixel right
  // and two up, which tells a flip or a swap of axes.
  const View view = perspective_view({64, 64}, {0.0, 0.0, 4.0});
  const Image<Key> image = draw_all(*context_, quad_scene(0.5F, {4.0 / 64, 8.0 / 64, 0.0}), view);
  const Rect expected{25, 22, 41, 38};
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      const bool inside = x >= expected.x0 && x < expected.x1 && y >= expected.y0 && y < expected.y1;
      const Key key = image.at(x, y);
      ASSERT_EQ(key != kNoKey, inside) << x << ' ' << y;
      if (!inside) continue;
      const double depth = reversed_depth(view, 4.0);
      EXPECT_NEAR(static_cast<double>(key_depth(key)), depth, 1e-6 * depth);
      // Below the diagonal from lower left to upper right: triangle 0.
      const int right = x - expected.x0;
      const int up = expected.y1 - 1 - y;
      if (right != up) {
        EXPECT_EQ(key_surface(key), right > up ? 0U : 1U) << x << ' ' << y;
      }
    }
  }
}

TEST_P(RasterizerTest, AWrittenAndLoadedSceneHasTheSameKeys) {
  const Scene scene = generate_scene("gallery?s=1&k=1&n=2");
  const test::TemporaryFolder folder;
  const std::vector<std::byte> file = encode_glb(scene);
  const Scene loaded =
      load_gltf(folder.write("scene.glb", {reinterpret_cast<const char*>(file.data()), file.size()}), {}).scene;
  for (std::size_t i = 0; i < scene.cameras.size(); ++i) {
    const Size size{160, 120};
    const Image<Key> image = draw_all(*context_, scene, make_view(scene.cameras[i], size, scene.bounds));
    EXPECT_GT(covered(image), 10000U);
    EXPECT_TRUE(draw_all(*context_, loaded, make_view(loaded.cameras.at(i), size, loaded.bounds)) == image)
        << scene.cameras[i].name;
  }
}

TEST_P(RasterizerTest, DepthFollowsDistanceOnASlantedPlane) {
  Scene scene = quad_scene(1.0F, {0.0, 0.0, 0.0});
  scene.instances[0].to_world = glm::rotate(glm::dmat4(1.0), 1.0, glm::dvec3(0.0, 1.0, 0.0));
  const View view = perspective_view({200, 150}, {0.0, 0.0, 3.0});
  const Image<Key> image = draw_all(*context_, scene, view);
  EXPECT_GT(covered(image), 1000U);
  const glm::dvec3 normal(scene.instances[0].to_world[2]);
  for (int y = 0; y < 150; ++y) {
    for (int x = 0; x < 200; ++x) {
      if (image.at(x, y) == kNoKey) continue;
      const Ray ray = view_ray(view, x + 0.5, y + 0.5);
      const double depth = reversed_depth(view, -glm::dot(ray.origin, normal) / glm::dot(ray.direction, normal));
      // Vertices snap to 1/256 pixel, which tilts the plane a little.
      EXPECT_NEAR(static_cast<double>(key_depth(image.at(x, y))), depth, 1e-4 * depth);
    }
  }
}

TEST_P(RasterizerTest, ThePixelsRayMeetsTheKeysTriangle) {
  const Scene scene = mixed_scene();
  const View view = perspective_view({240, 160});
  const Image<Key> image = draw_all(*context_, scene, view);
  std::size_t met = 0;
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      if (image.at(x, y) == kNoKey) continue;
      const SurfaceLocation location = locate_surface(scene, key_surface(image.at(x, y)));
      const Instance& instance = scene.instances[location.instance];
      const Mesh& mesh = scene.mesh_of(instance);
      const glm::uvec3 corners = mesh.triangles[location.triangle];
      const glm::dvec3 a = world_position(instance, mesh.positions[corners.x]);
      const glm::dvec3 e1 = world_position(instance, mesh.positions[corners.y]) - a;
      const glm::dvec3 e2 = world_position(instance, mesh.positions[corners.z]) - a;
      const Ray ray = view_ray(view, x + 0.5, y + 0.5);
      // origin + t direction = a + u e1 + v e2
      const glm::dvec3 solution = glm::inverse(glm::dmat3(-ray.direction, e1, e2)) * (ray.origin - a);
      const double least = std::min({solution.y, solution.z, 1.0 - solution.y - solution.z});
      const double depth = reversed_depth(view, solution.x);
      if (least > -0.05 && std::abs(static_cast<double>(key_depth(image.at(x, y))) - depth) < 0.01 * depth) ++met;
    }
  }
  // All but slivers, whose corners snap to 1/256 pixel.
  EXPECT_GT(static_cast<double>(met), 0.995 * static_cast<double>(covered(image)));
  EXPECT_GT(met, 10000U);
}

TEST_P(RasterizerTest, PartsOfTheScreenHaveTheKeysOfTheWhole) {
  const Scene scene = mixed_scene();
  const View view = perspective_view({333, 217});
  const Image<Key> whole = draw_all(*context_, scene, view);
  EXPECT_GT(covered(whole), 30000U);
  const std::vector<Rect> quarters{{0, 0, 166, 108}, {166, 0, 333, 108}, {0, 108, 166, 217}, {166, 108, 333, 217}};
  EXPECT_TRUE(whole == draw_parts(*context_, scene, std::array{all_of(scene)}, view, quarters));
  std::vector<Rect> odd;
  for (int y = 0; y < 217; y += 31) {
    for (int x = -5; x < 333; x += 37) odd.push_back({x, y, x + 37, y + 31});
  }
  EXPECT_TRUE(whole == draw_parts(*context_, scene, std::array{all_of(scene)}, view, odd));
  for (const Rect& rect : {Rect{40, 50, 41, 51}, Rect{300, 3, 333, 217}, Rect{-100, -100, 20, 30}}) {
    const Image<Key> part = draw_parts(*context_, scene, std::array{all_of(scene)}, view, std::array{rect});
    for (int y = 0; y < 217; ++y) {
      for (int x = 0; x < 333; ++x) {
        const bool inside = x >= rect.x0 && x < rect.x1 && y >= rect.y0 && y < rect.y1;
        ASSERT_EQ(part.at(x, y), inside ? whole.at(x, y) : kNoKey) << x << ' ' << y;
      }
    }
  }
}

TEST_P(RasterizerTest, PartsMergedByMaximumHaveTheKeysOfTheWhole) {
  const Scene scene = mixed_scene();
  const View view = perspective_view({257, 190});
  const Image<Key> whole = draw_all(*context_, scene, view);
  for (const std::uint32_t parts : {2U, 3U, 7U}) {
    TileLayer<Key> layer(FrameLayout({view.size()}));
    for (std::uint32_t part = 0; part < parts; ++part) {
      std::vector<SurfaceRange> ranges;  // dealt like cards, 77 triangles each, in descending order
      for (std::uint32_t first = 77 * part; first < scene.triangles; first += 77 * parts) {
        ranges.push_back({first, std::min(first + 77, scene.triangles)});
      }
      std::ranges::reverse(ranges);
      Rasterizer rasterizer(*context_, scene, ranges, 1);
      rasterizer.draw(view, 0, std::array{view.block}, layer);
    }
    EXPECT_TRUE(whole == to_image(layer, 0)) << parts << " shares";
  }
}

TEST_P(RasterizerTest, CullingChangesNothing) {
  Scene scene = mixed_scene();
  std::mt19937 random(11);
  const auto in = [&random](double from, double to) {
    return from + (to - from) * static_cast<double>(random()) / 4294967296.0;
  };
  // Many small things, so that some edge of the part passes close by one of them.
  scene.meshes.push_back(waves(4));
  for (int i = 0; i < 1500; ++i) {
    scene.instances.push_back(placed(2, {in(-4, 4), in(-4, 4), in(-4, 4)}, in(0.0, 6.28), in(0.01, 0.1)));
  }
  finish_scene(scene);
  std::size_t drawn = 0;
  for (int i = 0; i < 24; ++i) {
    View view = perspective_view({97 + i, 71});
    view.eye = {in(-2, 2), in(-2, 2), in(-2, 4)};
    const glm::dmat4 turn =
        glm::rotate(glm::dmat4(1.0), in(0.0, 6.28), glm::normalize(glm::dvec3(in(-1, 1), in(-1, 1), in(0.1, 1))));
    view.axes = glm::dmat3(turn);
    // Off-axis up to where the axis is far off the screen, and wide up to 170 degrees.
    view.left = in(-12.0, 10.0);
    view.right = view.left + in(0.01, 6.0);
    view.bottom = in(-8.0, 7.0);
    view.top = view.bottom + in(0.01, 4.0);
    view.near_distance = std::exp2(-static_cast<double>(i % 20));
    view.orthographic = i % 6 == 5;
    view.far_distance = view.near_distance + 5.0;
    const int x = static_cast<int>(in(0, 60));
    const int y = static_cast<int>(in(0, 40));
    const std::array part{Rect{x, y, x + 1 + static_cast<int>(in(0, 50)), y + 1 + static_cast<int>(in(0, 40))}};
    const Image<Key> culled = draw_parts(*context_, scene, std::array{all_of(scene)}, view, part);
    EXPECT_TRUE(culled == draw_parts(*context_, scene, std::array{all_of(scene)}, view, part, Culling::None)) << i;
    drawn += covered(culled);
  }
  EXPECT_GT(drawn, 3000U);
}

TEST_P(RasterizerTest, ChunksOutsideThePartAreNotDrawn) {
  Scene scene;
  scene.meshes = {waves(200)};
  scene.instances = {placed(0, {0.0, 0.0, 0.0})};
  finish_scene(scene);
  const View view = perspective_view({256, 256}, {0.0, 0.0, 2.25});
  TileLayer<Key> layer(FrameLayout({view.size()}));
  Rasterizer rasterizer(*context_, scene, std::array{all_of(scene)}, 1);
  rasterizer.draw(view, 0, std::array{Rect{0, 0, 256, 64}}, layer);
  const RasterStats& stats = rasterizer.stats();
  EXPECT_EQ(stats.triangles_drawn + stats.triangles_culled, scene.triangles);
  EXPECT_GT(stats.triangles_drawn, scene.triangles / 6);
  EXPECT_LT(stats.triangles_drawn, scene.triangles / 3);
  EXPECT_LE(stats.pixels_read, 256U * 64U);
}

TEST_P(RasterizerTest, RepeatedDrawsAndThreadsGiveTheSameKeys) {
  const Scene scene = mixed_scene();
  const View view = perspective_view({300, 200});
  const Image<Key> first = draw_all(*context_, scene, view);
  TileLayer<Key> layer(FrameLayout({view.size()}));
  Rasterizer rasterizer(*context_, scene, std::array{all_of(scene)}, 3);
  for (int i = 0; i < 3; ++i) {
    rasterizer.draw(view, 0, std::array{view.block}, layer);  // the maximum with itself
    EXPECT_TRUE(first == to_image(layer, 0));
    if (i == 1) layer.clear();
  }
}

/// Of 240 000 triangles, more than one context draws where there are threads; half of them lie in the other half.
Scene large_scene() {
  Scene scene;
  scene.meshes = {waves(200), soup(3000, 7)};
  scene.instances = {placed(0, {0.0, 0.0, 0.0}, 0.4, 1.5), placed(1, {0.0, 0.0, 0.0}),
                     placed(0, {0.0, 0.0, 0.0}, 0.4, 1.5), placed(0, {0.5, 0.0, 0.5}, 1.0)};
  scene.instances[3].to_world[0] *= -1.0;
  finish_scene(scene);
  return scene;
}

TEST_P(RasterizerTest, AnyNumberOfContextsGivesTheSameKeys) {
  const Scene scene = large_scene();
  const View view = perspective_view({300, 200});
  for (const DepthFormat format : {DepthFormat::Float32, DepthFormat::Bits16}) {
    TileLayer<Key> expected(FrameLayout({view.size()}));
    expected.set_depth_format(format);
    Rasterizer alone(*context_, scene, std::array{all_of(scene)}, 1);
    alone.draw(view, 0, std::array{view.block}, expected);
    EXPECT_GT(covered(to_image(expected, 0)), 30000U);
    for (const int threads : {2, 7, 16}) {
      TileLayer<Key> layer(FrameLayout({view.size()}));
      layer.set_depth_format(format);
      Rasterizer rasterizer(*context_, scene, std::array{all_of(scene)}, threads);
      for (int i = 0; i < 2; ++i) {
        rasterizer.draw(view, 0, std::array{view.block}, layer);
        EXPECT_TRUE(to_image(expected, 0) == to_image(layer, 0)) << threads;
        layer.clear();
      }
      if (context_->software() && GetParam() == "egl") {
        EXPECT_GT(rasterizer.stats().pixels_read, alone.stats().pixels_read) << "several contexts drew";
      }
      EXPECT_EQ(rasterizer.stats().triangles_drawn, alone.stats().triangles_drawn);
    }
  }
}

TEST_P(RasterizerTest, AllContextsHaveWhatIsLoadedLater) {
  const Scene scene = large_scene();
  const View view = perspective_view({200, 150});
  const std::array halves{SurfaceRange{0, scene.triangles / 3 * 2}, SurfaceRange{scene.triangles / 3, scene.triangles}};
  Rasterizer rasterizer(*context_, scene, std::array{all_of(scene)}, 4);
  for (const SurfaceRange& half : {halves[0], halves[1], halves[0]}) {
    rasterizer.load(collect_geometry(scene, std::array{half}));
    TileLayer<Key> layer(FrameLayout({view.size()}));
    rasterizer.draw(view, 0, std::array{view.block}, layer);
    EXPECT_TRUE(to_image(layer, 0) == draw_parts(*context_, scene, std::array{half}, view, std::array{view.block}));
  }
}

TEST_P(RasterizerTest, ViewsOfDifferentSizesTakeTurns) {
  const Scene scene = mixed_scene();
  Rasterizer rasterizer(*context_, scene, std::array{all_of(scene)}, 1);
  const std::vector<Size> sizes{{40, 30}, {600, 20}, {40, 30}, {33, 500}, {1, 1}, {600, 20}};
  TileLayer<Key> layer{FrameLayout(sizes)};
  for (std::size_t screen = 0; screen < sizes.size(); ++screen) {
    const View view = perspective_view(sizes[screen]);
    rasterizer.draw(view, screen, std::array{view.block}, layer);
    EXPECT_TRUE(to_image(layer, screen) == draw_all(*context_, scene, view)) << screen;
  }
}

TEST_P(RasterizerTest, TheNearerSurfaceWinsAndOfEqualOnesTheLowerId) {
  Scene scene;
  scene.meshes = {quad(1.0F)};
  scene.instances = {placed(0, {0.0, 0.0, -1.0}), placed(0, {0.0, 0.0, 0.0}), placed(0, {0.0, 0.0, 0.0}),
                     placed(0, {0.0, 0.0, -2.0})};
  finish_scene(scene);
  const View view = perspective_view({50, 50}, {0.0, 0.0, 3.0});
  const Image<Key> whole = draw_all(*context_, scene, view);
  for (const Key key : whole.pixels()) {
    if (key != kNoKey) {
      EXPECT_TRUE(key_surface(key) == 2 || key_surface(key) == 3);
    }
  }
  EXPECT_GT(covered(whole), 1000U);
  // The tie is decided alike when the two come from different ranks, in either order.
  TileLayer<Key> layer(FrameLayout({view.size()}));
  for (const SurfaceRange& part : {SurfaceRange{4, 6}, SurfaceRange{2, 4}}) {
    Rasterizer(*context_, scene, std::array{part}, 1).draw(view, 0, std::array{view.block}, layer);
  }
  EXPECT_TRUE(whole == to_image(layer, 0));
}

TEST_P(RasterizerTest, BothSidesOfASurfaceAreDrawn) {
  Scene scene = quad_scene(0.5F, {0.0, 0.0, 0.0});
  const View view = perspective_view({40, 40}, {0.0, 0.0, 3.0});
  const std::size_t front = covered(draw_all(*context_, scene, view));
  scene.instances[0].to_world[0] *= -1.0;
  EXPECT_EQ(covered(draw_all(*context_, scene, view)), front);
  EXPECT_GT(front, 0U);
}

TEST_P(RasterizerTest, ALargeOffsetOfSceneAndEyeCostsNothing) {
  Scene scene = mixed_scene();
  View view = perspective_view({200, 150});
  const Image<Key> here = draw_all(*context_, scene, view);
  const glm::dvec3 offset(16777216.0, -8388608.0, 33554432.0);
  for (Instance& instance : scene.instances) instance.to_world[3] += glm::dvec4(offset, 0.0);
  view.eye += offset;
  // The scene's own translations round to 2^-28 m there, less than a float's step at a metre.
  const Image<Key> there = draw_all(*context_, scene, view);
  std::size_t differing = 0;
  for (std::size_t i = 0; i < here.pixels().size(); ++i) {
    if (key_surface(here.pixels()[i]) != key_surface(there.pixels()[i])) ++differing;
  }
  EXPECT_EQ(differing, 0U);
}

TEST_P(RasterizerTest, OrthographicDepthIsLinear) {
  View view = perspective_view({32, 32}, {0.0, 0.0, 4.0});
  view.left = view.bottom = -1.0;
  view.right = view.top = 1.0;
  view.orthographic = true;
  view.near_distance = 1.0;
  view.far_distance = 9.0;
  const Image<Key> image = draw_all(*context_, quad_scene(0.5F, {0.0, 0.0, 0.0}), view);
  EXPECT_EQ(covered(image), 16U * 16U);
  EXPECT_NEAR(static_cast<double>(key_depth(image.at(16, 16))), 5.0 / 8.0, 1e-6);
  // Past the far plane and before the near one there is nothing.
  EXPECT_EQ(covered(draw_all(*context_, quad_scene(0.5F, {0.0, 0.0, -6.0}), view)), 0U);
  EXPECT_EQ(covered(draw_all(*context_, quad_scene(0.5F, {0.0, 0.0, 3.5}), view)), 0U);
}

TEST_P(RasterizerTest, WhatIsNearerThanTheNearPlaneIsGone) {
  const View view = perspective_view({32, 32}, {0.0, 0.0, 3.0});
  EXPECT_EQ(covered(draw_all(*context_, quad_scene(9.0F, {0.0, 0.0, 2.95}), view)), 0U);
  EXPECT_EQ(covered(draw_all(*context_, quad_scene(9.0F, {0.0, 0.0, 2.9}), view)), 32U * 32U);
  EXPECT_EQ(covered(draw_all(*context_, quad_scene(9.0F, {0.0, 0.0, 3.5}), view)), 0U);
}

TEST_P(RasterizerTest, NothingToDrawLeavesTheLayerEmpty) {
  Scene empty;
  finish_scene(empty);
  const Scene scene = mixed_scene();
  const View view = perspective_view({70, 70});
  TileLayer<Key> layer(FrameLayout({view.size()}));
  Rasterizer(*context_, empty, {}, 1).draw(view, 0, std::array{view.block}, layer);
  Rasterizer(*context_, scene, {}, 1).draw(view, 0, std::array{view.block}, layer);
  Rasterizer(*context_, scene, std::array{SurfaceRange{5, 5}}, 1).draw(view, 0, std::array{view.block}, layer);
  Rasterizer(*context_, scene, std::array{all_of(scene)}, 1)
      .draw(view, 0, std::array{Rect{70, 0, 90, 70}, Rect{5, 5, 5, 9}}, layer);
  EXPECT_EQ(layer.active_tiles(), 0U);
}

TEST_P(RasterizerTest, DegenerateHugeAndOverflowingTrianglesDoNoHarm) {
  Scene scene;
  Mesh mesh = quad(1.0F);
  mesh.triangles.emplace_back(0, 0, 0);
  mesh.triangles.emplace_back(0, 1, 1);
  mesh.positions.emplace_back(3e38F, -3e38F, 3e38F);
  mesh.normals.emplace_back(0.0F, 0.0F, 1.0F);
  mesh.triangles.emplace_back(0, 1, 4);
  scene.meshes = {mesh, quad(1.0F)};
  scene.instances = {placed(1, {0.0, 0.0, 0.0}, 0.0, 1e4), placed(0, {0.0, 0.0, -1.0}, 0.0, 1e300),
                     placed(1, {0.0, 0.0, 0.0}, 0.0, 0.0), placed(0, {0.0, 0.0, -2.0})};
  finish_scene(scene);
  const View view = perspective_view({40, 40}, {0.0, 0.0, 2.0});
  const Image<Key> image = draw_all(*context_, scene, view);
  EXPECT_EQ(covered(image), 1600U);
  for (const Key key : image.pixels()) {
    EXPECT_TRUE(std::isfinite(key_depth(key)) && key_depth(key) > 0.0F);
    EXPECT_LT(key_surface(key), 2U);  // the quad of 20 km fills the screen before the rest
  }
  EXPECT_TRUE(image == draw_all(*context_, scene, view, Culling::None));
}

TEST_P(RasterizerTest, TilesOfADistantObjectAloneBecomeActive) {
  const View view = perspective_view({640, 640}, {0.0, 0.0, 100.0});
  const Scene scene = quad_scene(1.0F, {0.0, 0.0, 0.0});
  TileLayer<Key> layer(FrameLayout({view.size()}));
  Rasterizer rasterizer(*context_, scene, std::array{all_of(scene)}, 1);
  rasterizer.draw(view, 0, std::array{view.block}, layer);
  EXPECT_EQ(layer.active_tiles(), 4U);
  EXPECT_LT(rasterizer.stats().pixels_read, 400U);
}

TEST_P(RasterizerTest, BlocksOfAScreenAreDrawnAsOneScreensPart) {
  // A block has its own viewport, so its keys may differ from the whole screen's in single pixels, no more.
  const Scene scene = mixed_scene();
  const View whole = perspective_view({256, 128});
  const Image<Key> image = draw_all(*context_, scene, whole);
  std::size_t differing = 0;
  for (const View& block : split_into_blocks(whole, 128)) {
    const Image<Key> part = draw_all(*context_, scene, block);
    for (int y = 0; y < part.height(); ++y) {
      for (int x = 0; x < part.width(); ++x) {
        differing += key_surface(part.at(x, y)) == key_surface(image.at(block.block.x0 + x, y)) ? 0U : 1U;
      }
    }
  }
  EXPECT_LT(differing, 40U);
}

TEST_P(RasterizerTest, ChunksOfSomeSurfacesAreDrawnAloneAndTogetherGiveAll) {
  const Scene scene = mixed_scene();
  const View view = perspective_view({256, 200});
  const Image<Key> whole = draw_all(*context_, scene, view);
  Rasterizer rasterizer(*context_, scene, std::array{SurfaceRange{0, scene.triangles}}, 2);
  TileLayer<Key> layer(FrameLayout({view.screen}));
  const std::vector<SceneChunk> chunks = make_scene_chunks(scene, 1).chunks;
  for (std::size_t turn = 0; turn < 3; ++turn) {
    std::vector<SurfaceRange> some;
    for (std::size_t i = turn; i < chunks.size(); i += 3) some.push_back(chunks[i].surfaces);
    const std::vector<SurfaceRange> only = merged_ranges(some, scene.triangles);
    TileLayer<Key> part(layer.layout());
    rasterizer.draw(view, 0, std::array{view.block}, part, &only);
    EXPECT_LE(rasterizer.stats().chunks_drawn, some.size());
    EXPECT_GT(rasterizer.stats().chunks_drawn, 0U);
    const Image<Key> image = to_image(part, 0);
    for (const Key key : image.pixels()) {
      if (key == kNoKey) continue;
      const auto has = [&](const SurfaceRange& range) {
        return key_surface(key) >= range.first && key_surface(key) < range.last;
      };
      ASSERT_TRUE(std::ranges::any_of(only, has)) << key_surface(key);
    }
    rasterizer.draw(view, 0, std::array{view.block}, layer, &only);
  }
  EXPECT_TRUE(to_image(layer, 0) == whole);
}

TEST_P(RasterizerTest, TheFingerprintIsTheSameEveryTime) {
  const std::uint64_t first = raster_fingerprint(*context_);
  EXPECT_EQ(raster_fingerprint(*context_), first);
  EXPECT_EQ(raster_fingerprint(*make_gl_context({.backend = GetParam()})), first);
}

}  // namespace
}  // namespace hpr
