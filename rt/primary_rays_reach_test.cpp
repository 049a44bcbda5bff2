#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <memory>

#include "rt/primary_rays.h"
#include "rt/test_scene.h"

namespace hpr {
namespace {

TEST(PrimaryRaysReach, PixelsOutOfReachShowNothingOfOthers) {
  Scene scene;
  test::place(scene, test::add_mesh(scene, test::quad({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0)));
  finish_scene(scene);
  View view = test::view_from({0.1, 0.2, 4}, {0.1, 0.2, 0}, {9, 9}, scene);
  view.orthographic = true;
  view.far_distance = 30.0;
  view.left = view.bottom = -9e18;
  view.right = view.top = 9e18;
  // Points that are nowhere: its pixels look through the plane, and none is known to see nothing.
  const Image<glm::vec3> nowhere({1, 1}, glm::vec3(std::numeric_limits<float>::infinity()));
  view.points = PixelPoints{.map = std::make_shared<PointMap>(nowhere), .orthographic = true};

  const RayScene rays(scene, RaySpace(scene.bounds), 1);
  TileLayer<Key> layer(FrameLayout({view.size()}));
  PrimaryRays primary(scene, rays, 1);
  primary.draw(view, 0, std::array{Rect{0, 0, 9, 9}}, layer);
  EXPECT_EQ(primary.stats().invalid, 9U * 9U - 1U);
  const Image<Key> keys = to_image(layer, 0);
  EXPECT_EQ(std::ranges::count(keys.pixels(), kNoKey), 9 * 9 - 1);
  EXPECT_NE(keys.at(4, 4), kNoKey);
}

}  // namespace
}  // namespace hpr
