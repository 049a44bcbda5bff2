#include "rt/trace/primary_rays.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <random>

#include "rt/test_scene.h"

namespace hpr {
namespace {

double uniform(std::mt19937& random, double from, double to) {
  return from + (to - from) * static_cast<double>(random()) / 4294967296.0;
}

/// Triangles of all sizes that cut through one another, some of them slivers.
Mesh soup(std::uint32_t count) {
  std::mt19937 random(5);
  Mesh mesh;
  for (std::uint32_t triangle = 0; triangle < count; ++triangle) {
    const double size = std::exp2(-uniform(random, 0.0, 7.0));
    const glm::dvec3 center(uniform(random, -1, 1), uniform(random, -1, 1), uniform(random, -1, 1));
    const double thin = triangle % 5 == 0 ? 1e-4 : 1.0;
    for (int corner = 0; corner < 3; ++corner) {
      const glm::dvec3 to(uniform(random, -1, 1), uniform(random, -1, 1) * thin, uniform(random, -1, 1));
      mesh.positions.emplace_back(center + size * to);
    }
    mesh.triangles.push_back(glm::uvec3(0U, 1U, 2U) + 3U * triangle);
  }
  return mesh;
}

/// A soup, spheres placed once and several times, turned and mirrored, and layers in one plane.
Scene mixed_scene() {
  Scene scene;
  test::place_mesh(scene, test::add_mesh(scene, soup(700)));
  test::place_mesh(scene, test::add_mesh(scene, test::sphere(0.8, 24, 0)),
                   glm::translate(glm::dmat4(1.0), {0.9, -0.3, 0.2}));
  const std::uint32_t shared = test::add_mesh(scene, test::sphere(0.5, 16, 0));
  const glm::dmat4 one(1.0);
  test::place_mesh(scene, shared, glm::translate(one, {-1.0, 0.4, 0.3}));
  test::place_mesh(scene, shared, glm::rotate(glm::translate(one, {0.0, -0.9, 0.5}), 0.7, glm::dvec3(0.6, 0.8, 0.0)));
  test::place_mesh(scene, shared, glm::scale(glm::translate(one, {0.2, 0.9, -0.5}), {-1.5, 0.7, 1.0}));
  const std::uint32_t wall = test::add_mesh(scene, test::quad({-3, -3, -1}, {6, 0, 0}, {0, 6, 0}, 0));
  for (int copy = 0; copy < 3; ++copy) test::place_mesh(scene, wall);
  finish_scene(scene);
  return scene;
}

View front_view(const Scene& scene, Size size = {203, 150}) {
  return test::view_from({0.4, 0.3, 4.0}, {0.0, 0.0, 0.0}, size, scene);
}

Rect whole(const View& view) {
  return {0, 0, view.size().width, view.size().height};
}

struct Drawn {
  Image<Key> keys;
  PrimaryRayStats stats;
};

Drawn draw(const Scene& scene, const View& view, int threads = 1) {
  const RayScene rays(scene, RaySpace(scene), threads);
  TileLayer<Key> layer(FrameLayout({view.size()}));
  PrimaryRays primary(scene, rays, threads);
  primary.draw(view, 0, std::array{whole(view)}, layer);
  return {to_image(layer, 0), primary.stats()};
}

std::size_t covered(const Image<Key>& image) {
  return image.pixels().size() - static_cast<std::size_t>(std::ranges::count(image.pixels(), kNoKey));
}

/// The share of pixels that show another surface than a search through all triangles in double finds; depths of the
/// others must agree to a float's step.
double disagreement(const Scene& scene, const View& view, const Image<Key>& found) {
  const Image<Key> expected = to_image(test::cast_keys(scene, std::span(&view, 1)), 0);
  std::size_t differing = 0;
  for (std::size_t i = 0; i < found.pixels().size(); ++i) {
    const Key a = found.pixels()[i];
    const Key b = expected.pixels()[i];
    if ((a == kNoKey) != (b == kNoKey) || key_surface(a) != key_surface(b)) {
      ++differing;
    } else if (a != kNoKey) {
      EXPECT_NEAR(static_cast<double>(key_depth(a)) / static_cast<double>(key_depth(b)), 1.0, 1.3e-7);
    }
  }
  return static_cast<double>(differing) / static_cast<double>(found.pixels().size());
}

TEST(PrimaryRays, SeeWhatASearchThroughAllTrianglesSees) {
  const Scene scene = mixed_scene();
  const View view = front_view(scene);
  const Drawn drawn = draw(scene, view);
  EXPECT_LT(disagreement(scene, view, drawn.keys), 5e-4);
  EXPECT_GT(covered(drawn.keys), 20000U);
  EXPECT_EQ(drawn.stats.rays, view.size().area());
  EXPECT_EQ(drawn.stats.invalid, 0U);
}

/// Keys from so many ranks' shares of the scene, `run` surfaces at a time, cut without regard for meshes and
/// instances.
Image<Key> draw_shares(const Scene& scene, const View& view, std::uint32_t ranks, std::uint32_t run) {
  TileLayer<Key> layer(FrameLayout({view.size()}));
  for (std::uint32_t rank = 0; rank < ranks; ++rank) {
    std::vector<SurfaceRange> ranges;
    for (std::uint32_t first = run * rank; first < scene.triangles; first += run * ranks) {
      ranges.push_back({first, std::min(first + run, scene.triangles)});
    }
    std::ranges::reverse(ranges);
    const RayScene rays(scene, RaySpace(scene), 1, ranges);
    PrimaryRays(scene, rays, 1).draw(view, 0, std::array{whole(view)}, layer);
  }
  return to_image(layer, 0);
}

TEST(PrimaryRays, SharesOfTheSceneMergeIntoTheKeysOfTheWhole) {
  const Scene scene = mixed_scene();
  const View view = front_view(scene);
  const Image<Key> expected = draw(scene, view).keys;
  for (const std::uint32_t ranks : {2U, 3U, 5U, 12U}) {
    EXPECT_TRUE(expected == draw_shares(scene, view, ranks, 93)) << ranks << " ranks";
  }
}

TEST(PrimaryRays, PartsThreadsAndRepetitionChangeNothing) {
  const Scene scene = mixed_scene();
  const View view = front_view(scene);
  const Image<Key> expected = draw(scene, view).keys;
  const RayScene rays(scene, RaySpace(scene), 2);
  PrimaryRays primary(scene, rays, 3);
  TileLayer<Key> layer(FrameLayout({{64, 64}, view.size()}));
  std::vector<Rect> parts;
  for (int y = 0; y < 150; y += 29) {
    for (int x = 0; x < 203; x += 31) parts.push_back({x, y, x + 31, y + 29});
  }
  parts.push_back({60, 60, 70, 70});  // once more
  primary.draw(view, 1, parts, layer);
  EXPECT_TRUE(expected == to_image(layer, 1));
  primary.draw(view, 1, std::array{whole(view)}, layer);
  EXPECT_TRUE(expected == to_image(layer, 1));
  EXPECT_EQ(layer.active_tiles(), layer.layout().tiles_of(1).count);
}

/// Spheres and a few splinters with much of nothing between them.
Scene floating_scene() {
  Scene scene;
  Mesh splinters = soup(40);
  for (glm::vec3& position : splinters.positions) position = 0.3F * position + glm::vec3(0.5F, -1.0F, 0.3F);
  test::place_mesh(scene, test::add_mesh(scene, splinters));
  const std::uint32_t shared = test::add_mesh(scene, test::sphere(0.3, 24, 0));
  for (const double x : {-1.2, -0.4, 0.6, 1.2}) {
    const glm::dmat4 there = glm::translate(glm::dmat4(1.0), {x, 0.3 * x, 0.5});
    test::place_mesh(scene, shared, glm::scale(glm::rotate(there, x, glm::dvec3(0.6, 0.8, 0.0)), {x, 1.0, 0.4}));
  }
  finish_scene(scene);
  return scene;
}

TEST(PrimaryRays, LooksTogetherSeeWhatEachSeesAloneAndMissesNothing) {
  const Scene scene = floating_scene();
  const RayScene rays(scene, RaySpace(scene), 2);
  PrimaryRays primary(scene, rays, 2);
  std::vector<View> views(11, front_view(scene));
  for (std::size_t i = 0; i < views.size(); ++i) {
    views[i].jitter = {0.9 * std::sin(5.0 * static_cast<double>(i)), 1.7 * std::cos(3.0 * static_cast<double>(i))};
  }
  const FrameLayout layout({views.front().size()});
  std::vector<TileLayer<Key>> layers;
  for (std::size_t i = 0; i < views.size(); ++i) layers.emplace_back(layout);
  std::vector<TileLayer<Key>*> together;
  for (TileLayer<Key>& layer : layers) together.push_back(&layer);
  const Rect all = whole(views.front());
  primary.draw(views, 0, std::span(&all, 1), together);
  for (std::size_t i = 0; i < views.size(); ++i) {
    TileLayer<Key> alone(layout);
    primary.draw(views[i], 0, std::span(&all, 1), alone);
    EXPECT_TRUE(to_image(alone, 0) == to_image(layers[i], 0)) << "look " << i;
    if (i < 2) {
      EXPECT_LT(disagreement(scene, views[i], to_image(alone, 0)), 2e-4) << "look " << i;
    }
    EXPECT_LT(primary.stats().rays, all.area() / 2) << "background is left out";
    EXPECT_GT(covered(to_image(alone, 0)), all.area() / 20);
    EXPECT_EQ(alone.active_tiles(), layers[i].active_tiles());
  }
}

TEST(PrimaryRays, APartHoldsNoKeyOutsideOfIt) {
  const Scene scene = mixed_scene();
  const View view = front_view(scene);
  const Image<Key> expected = draw(scene, view).keys;
  const RayScene rays(scene, RaySpace(scene), 1);
  TileLayer<Key> layer(FrameLayout({view.size()}));
  PrimaryRays primary(scene, rays, 1);
  const Rect part{101, 67, 103, 300};
  primary.draw(view, 0, std::array{part, Rect{203, 0, 300, 150}, Rect{7, 7, 7, 90}}, layer);
  EXPECT_EQ(primary.stats().rays, 2U * 83U);
  for (int y = 0; y < 150; ++y) {
    for (int x = 0; x < 203; ++x) {
      const bool inside = x >= part.x0 && x < part.x1 && y >= part.y0;
      EXPECT_EQ(layer.at(0, x, y), inside ? expected.at(x, y) : kNoKey);
    }
  }
}

TEST(PrimaryRays, APowerOfTwoOfScaleChangesNoBit) {
  const Scene scene = mixed_scene();
  const View view = front_view(scene);
  const Image<Key> expected = draw(scene, view).keys;
  for (const int exponent : {-40, -3, 7, 60}) {
    const double factor = std::ldexp(1.0, exponent);
    Scene scaled = scene;
    for (Instance& instance : scaled.instances)
      instance.to_world = glm::scale(glm::dmat4(1.0), glm::dvec3(factor)) * instance.to_world;
    finish_scene(scaled);
    View from = view;
    from.eye *= factor;
    from.near_distance *= factor;
    EXPECT_TRUE(expected == draw(scaled, from).keys) << exponent;
  }
}

TEST(PrimaryRays, OfSurfacesInOnePlaneTheLowestIdIsSeen) {
  Scene scene;
  const std::uint32_t wall = test::add_mesh(scene, test::quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0));
  const std::uint32_t once = test::add_mesh(scene, test::quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0));
  test::place_mesh(scene, once);
  for (int copy = 0; copy < 4; ++copy) test::place_mesh(scene, wall);
  finish_scene(scene);
  const Image<Key> keys = draw(scene, test::view_from({0.7, 0.4, 2.0}, {0, 0, 0}, {90, 70}, scene)).keys;
  EXPECT_GT(covered(keys), 500U);
  for (const Key key : keys.pixels()) {
    if (key != kNoKey) {
      EXPECT_LT(key_surface(key), 2U);
    }
  }
}

TEST(PrimaryRays, SurfacesApartByLessThanAFloatStepAreToldApart) {
  // A millionth of the scene behind the other, and with the lower id.
  Scene scene;
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-1, -1, -1e-6F}, {2, 0, 0}, {0, 2, 0}, 0)));
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0)));
  finish_scene(scene);
  View view = test::view_from({0.2, 0.1, 1.5}, {0, 0, 0}, {64, 64}, scene);
  const Drawn drawn = draw(scene, view);
  std::size_t front = 0;
  for (const Key key : drawn.keys.pixels()) front += key != kNoKey && key_surface(key) >= 2 ? 1U : 0U;
  EXPECT_GT(front, 1000U);
  EXPECT_EQ(front, covered(drawn.keys));
  EXPECT_GT(drawn.stats.weighed, 0U);
}

TEST(PrimaryRays, SurfacesWithinAStepOfTheKeysDepthAreToldApartByTheirNumbers) {
  // From afar, and where an orthographic view's planes lie far apart, steps of depth are coarser than distances.
  Scene scene;
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0)));
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-1, -1, 0.005}, {2, 0, 0}, {0, 2, 0}, 0)));
  finish_scene(scene);
  View far = test::view_from({0, 0, 1e5}, {0, 0, 0}, {40, 30}, scene, 1e-5);
  far.near_distance = 0.1;
  View flat = test::view_from({0, 0, 3}, {0, 0, 0}, {40, 30}, scene);
  flat.orthographic = true;
  flat.far_distance = 1e6;
  View farther = far;
  farther.eye.z = 1e9;
  farther.left = farther.bottom = -5e-10;
  farther.right = farther.top = 5e-10;
  for (const View& view : {far, flat, farther}) {
    const Image<Key> whole = draw(scene, view).keys;
    EXPECT_EQ(covered(whole), view.size().area());
    for (const Key key : whole.pixels()) EXPECT_LT(key_surface(key), 2U) << "of equals the first is seen";
    for (const std::uint32_t ranks : {2U, 4U}) EXPECT_TRUE(whole == draw_shares(scene, view, ranks, 1)) << ranks;
  }
}

TEST(PrimaryRays, WhatLiesBeforeTheNearPlaneIsLookedThrough) {
  Scene scene;
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-9, -9, 2.95F}, {18, 0, 0}, {0, 18, 0}, 0)));
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-9, -9, 3.0F}, {18, 0, 0}, {0, 18, 0}, 0)));
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-9, -9, 0}, {18, 0, 0}, {0, 18, 0}, 0)));
  finish_scene(scene);
  View view = test::view_from({0, 0, 3.5}, {0, 0, 0}, {40, 30}, scene);
  for (const auto& [near, surface] : {std::pair{0.3, 2U}, {0.4999, 2U}, {0.5001, 0U}, {0.5499, 0U}, {0.5501, 4U}}) {
    view.near_distance = near;
    const Drawn drawn = draw(scene, view);
    EXPECT_EQ(covered(drawn.keys), view.size().area());
    for (const Key key : drawn.keys.pixels()) EXPECT_EQ(key_surface(key) / 2 * 2, surface) << near;
  }
  view.near_distance = 100.0;
  EXPECT_EQ(covered(draw(scene, view).keys), 0U);
}

TEST(PrimaryRays, OrthographicViewsSeeBetweenTheirPlanes) {
  const Scene scene = mixed_scene();
  View view = front_view(scene, {120, 120});
  view.orthographic = true;
  view.left = view.bottom = -1.5;
  view.right = view.top = 1.5;
  view.near_distance = 3.5;
  view.far_distance = 4.25;
  const Drawn drawn = draw(scene, view);
  EXPECT_GT(covered(drawn.keys), 1000U);
  EXPECT_LT(covered(drawn.keys), 14000U);
  for (const Key key : drawn.keys.pixels()) EXPECT_LE(key_depth(key), 1.0F);
  view.near_distance = 1.0;
  view.far_distance = 30.0;
  EXPECT_LT(disagreement(scene, view, draw(scene, view).keys), 1e-3);
  view.eye += 1000.0 * view.axes[2];
  view.far_distance += 1000.0;
  EXPECT_LT(disagreement(scene, view, draw(scene, view).keys), 1e-3);
}

TEST(PrimaryRays, EyesInsideFarAwayAndBesideTheAxisSeeRight) {
  const Scene scene = mixed_scene();
  View inside = test::view_from({0.9, -0.3, 0.2}, {0.0, 0.1, 0.0}, {100, 80}, scene);
  EXPECT_LT(disagreement(scene, inside, draw(scene, inside).keys), 1e-3);
  View far = test::view_from({300.0, 200.0, 900.0}, {0, 0, 0}, {100, 80}, scene, 0.005);
  EXPECT_LT(disagreement(scene, far, draw(scene, far).keys), 2e-3);
  EXPECT_GT(covered(draw(scene, far).keys), 1000U);
  View wall = front_view(scene, {150, 64});
  wall.left = 0.05;
  wall.right = 0.6;
  wall.bottom = -0.5;
  wall.top = -0.1;
  EXPECT_LT(disagreement(scene, wall, draw(scene, wall).keys), 1e-3);
  View block = front_view(scene);
  block.block = {64, 64, 203, 150};
  const Image<Key> all = draw(scene, front_view(scene)).keys;
  const Image<Key> part = draw(scene, block).keys;
  for (int y = 0; y < part.height(); ++y) {
    for (int x = 0; x < part.width(); ++x) EXPECT_EQ(part.at(x, y), all.at(64 + x, 64 + y));
  }
}

TEST(PrimaryRays, NothingAndImpossibleEyesSeeNothing) {
  Scene empty;
  finish_scene(empty);
  View view;
  view.screen = {70, 70};
  view.block = {0, 0, 70, 70};
  EXPECT_EQ(covered(draw(empty, view).keys), 0U);
  const Scene scene = mixed_scene();
  View lost = front_view(scene, {33, 9});
  lost.eye.x = std::nan("");
  const Drawn drawn = draw(scene, lost);
  EXPECT_EQ(covered(drawn.keys), 0U);
  EXPECT_EQ(drawn.stats.invalid, drawn.stats.rays);
  const RayScene none(scene, RaySpace(scene), 1, {});
  TileLayer<Key> layer(FrameLayout({{33, 9}}));
  PrimaryRays(scene, none, 1).draw(front_view(scene, {33, 9}), 0, std::array{Rect{0, 0, 33, 9}}, layer);
  EXPECT_EQ(layer.active_tiles(), 0U);
}

TEST(PrimaryRays, OnlyPixelsThatAreWantedHaveKeys) {
  const Scene scene = mixed_scene();
  const View view = front_view(scene, {150, 90});
  const Image<Key> all = draw(scene, view).keys;
  TileLayer<Key> layer(FrameLayout({view.size()}));
  PixelMask wanted(layer.layout());
  for (std::size_t tile = 0; tile < wanted.tiles(); ++tile) {
    for (std::size_t pixel = 0; pixel < kTilePixels; ++pixel) wanted.tile(tile)[pixel] = pixel % 3 == 0 ? 1 : 0;
    if (tile != 1) wanted.set_active(tile);  // there all are wanted
  }
  const RayScene rays(scene, RaySpace(scene), 2);
  PrimaryRays primary(scene, rays, 2);
  TileLayer<Key>* const only = &layer;
  primary.draw(std::span(&view, 1), 0, std::array{Rect{0, 0, 150, 90}}, std::span(&only, 1), &wanted);
  const Image<Key> some = to_image(layer, 0);
  for (int y = 0; y < all.height(); ++y) {
    for (int x = 0; x < all.width(); ++x) {
      const std::size_t tile = wanted.layout().tile_at(0, x, y);
      const bool is_wanted = !wanted.active(tile) || wanted.at(0, x, y) != 0;
      EXPECT_EQ(some.at(x, y), is_wanted ? all.at(x, y) : kNoKey) << x << ' ' << y;
    }
  }
}

}  // namespace
}  // namespace hpr
