#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>

#include "rt/test_scene.h"
#include "rt/trace/primary_rays.h"

namespace hpr {
namespace {

TEST(PrimaryRaysReach, PixelsOutOfReachShowNothingOfOthers) {
  Scene scene;
  test::place_mesh(scene, test::add_mesh(scene, test::quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0)));
  finish_scene(scene);
  View view = test::view_from({0.1, 0.2, 4}, {0.1, 0.2, 0}, {9, 9}, scene);
  view.orthographic = true;
  view.far_distance = 30.0;
  view.left = view.bottom = -9e18;
  view.right = view.top = 9e18;
  // Points that are nowhere: its pixels look through the plane, and none is known to see nothing.
  const Image<glm::vec3> nowhere({1, 1}, glm::vec3(std::numeric_limits<float>::infinity()));
  view.points = PixelPoints{.map = std::make_shared<PositionMap>(nowhere), .orthographic = true};

  const RayScene rays(scene, RaySpace(scene), 1);
  TileLayer<Key> layer(FrameLayout({view.size()}));
  PrimaryRays primary(scene, rays, 1);
  primary.draw(view, 0, std::array{Rect{0, 0, 9, 9}}, layer);
  EXPECT_EQ(primary.stats().invalid, 9U * 9U - 1U);
  const Image<Key> keys = to_image(layer, 0);
  EXPECT_EQ(std::ranges::count(keys.pixels(), kNoKey), 9 * 9 - 1);
  EXPECT_NE(keys.at(4, 4), kNoKey);
}

TEST(PrimaryRaysReach, WhatIsMetNowhereNearItsPlaceHidesNothingBehindIt) {
  const auto wall = test::quad({-6, -6, -1.5}, {12, 0, 0}, {0, 12, 0}, 0);
  Scene scene;
  test::place_mesh(scene, test::add_mesh(scene, wall));
  finish_scene(scene);
  const View view = test::view_from({0.3, 0.7, 3}, {0, 0, 0}, {64, 64}, scene);
  // Sheets in which the rays of single pixels almost lie: single precision may place hits on them far off.
  for (int i = 0; i < 256; ++i) {
    const Ray ray = view_ray(view, 4 * (i % 16) + 0.5, 4 * (i / 16) + 0.5);
    const glm::dvec3 along = glm::normalize(ray.direction);
    const glm::dvec3 side = 0.01 * glm::normalize(glm::cross(along, glm::dvec3(0.2, 1.0, 0.1)));
    const glm::dvec3 tilt = std::exp2(-10.0 - 16.0 * i / 256.0) * glm::cross(along, side / 0.01);
    const glm::dvec3 center = ray.origin + 2.5 * along;
    test::place_mesh(
        scene, test::add_mesh(scene, test::quad(center - along - tilt - side, 2.0 * side, 2.0 * (along + tilt), 0)));
  }
  finish_scene(scene);
  const RayScene rays(scene, RaySpace(scene), 1);
  TileLayer<Key> layer(FrameLayout({view.size()}));
  PrimaryRays primary(scene, rays, 1);
  primary.draw(view, 0, std::array{Rect{0, 0, 64, 64}}, layer);
  EXPECT_GT(primary.stats().retraced, 0U);
  EXPECT_EQ(std::ranges::count(to_image(layer, 0).pixels(), kNoKey), 0);
}

}  // namespace
}  // namespace hpr
