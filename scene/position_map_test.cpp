#include "scene/position_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "scene/view.h"

namespace hpr {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

/// Points of the plane z = -2 over [-1, 1] x [-0.5, 0.5], as a screen there has them.
Image<glm::vec3> plane(Size size) {
  Image<glm::vec3> points(size);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      points.at(x, y) = {2.0 * (x + 0.5) / size.width - 1.0, 0.5 - (y + 0.5) / size.height, -2.0};
    }
  }
  return points;
}

View window_view() {
  View view;
  view.eye = {5.0, 1.0, 2.0};
  view.left = -0.5;
  view.right = 0.5;
  view.bottom = -0.25;
  view.top = 0.25;
  view.screen = {64, 32};
  view.block = {16, 8, 48, 32};
  view.jitter = {0.2, -0.3};
  return view;
}

TEST(PositionMap, IsStraightBetweenItsPointsAndBeyondThem) {
  for (const Size size : {Size{1, 1}, Size{2, 2}, Size{7, 5}, Size{64, 32}}) {
    const PositionMap map(plane(size));
    for (const double s : {-0.01, 0.0, 0.1, 0.5, 0.77, 1.0, 1.01}) {
      for (const double t : {0.0, 0.3, 1.0}) {
        const auto point = map.at(s, t);
        ASSERT_TRUE(point);
        if (size.width == 1) {
          EXPECT_EQ(*point, glm::dvec3(0.0, 0.0, -2.0));
        } else {
          EXPECT_LT(glm::distance(*point, glm::dvec3(2.0 * s - 1.0, 0.5 - t, -2.0)), 1e-6);
        }
      }
    }
  }
}

TEST(PositionMap, APointThatIsMissingDarkensWhatNeedsItOnly) {
  Image<glm::vec3> points = plane({9, 7});
  points.at(4, 3) = {0.0F, kNone, 0.0F};
  points.at(0, 0) = {std::numeric_limits<float>::infinity(), 0.0F, 0.0F};
  const PositionMap map(points);
  for (int y = 0; y < 7; ++y) {
    for (int x = 0; x < 9; ++x) {
      const bool missing = (x == 4 && y == 3) || (x == 0 && y == 0);
      EXPECT_EQ(map.at((x + 0.5) / 9, (y + 0.5) / 7).has_value(), !missing) << x << ", " << y;
    }
  }
  EXPECT_FALSE(map.at(4.6 / 9, 2.6 / 7));
  EXPECT_FALSE(map.at(0.0, 0.0));
  EXPECT_TRUE(map.at(4.6 / 9, 2.5 / 7));
}

TEST(PositionMap, BlocksHoldAllThereIsAndNothingElse) {
  Image<glm::vec3> points = plane({40, 17});
  for (int y = 0; y < 17; ++y) {
    for (int x = 16; x < 32; ++x) points.at(x, y).x = kNone;
  }
  const PositionMap map(points);
  EXPECT_EQ(map.blocks().size(), 4U);  // the middle two of six are empty
  Bounds all = map.blocks().front().box;
  for (const PositionMap::Block& block : map.blocks()) {
    all.low = glm::min(all.low, block.box.low);
    all.high = glm::max(all.high, block.box.high);
  }
  EXPECT_LT(glm::distance(all.low, glm::dvec3(-1.0, -0.5, -2.0)), 1e-6);
  EXPECT_LT(glm::distance(all.high, glm::dvec3(1.0, 0.5, -2.0)), 1e-6);
}

TEST(PixelPoints, AreSeenBeforeTheEyeOnly) {
  const PixelPoints points{
      std::make_shared<const PositionMap>(plane({4, 4})), {0.0, 0.0, 1.0}, glm::dmat3(1.0), false, 1};
  EXPECT_EQ(points.seen({3.0, -1.5, -2.0}), glm::dvec2(1.0, -0.5));
  EXPECT_FALSE(points.seen({0.0, 0.0, 1.5}));
  EXPECT_FALSE(points.seen({0.0, 0.0, 1.0}));
  EXPECT_TRUE(points.seen({11.0, 0.0, 0.0}));
  EXPECT_FALSE(points.seen({12.0, 0.0, 0.0}));
  PixelPoints parallel = points;
  parallel.orthographic = true;
  parallel.scale = 2.0;
  EXPECT_EQ(parallel.seen({3.0, -1.5, 7.0}), glm::dvec2(6.0, -3.0));
}

TEST(PixelPoints, OnAScreensOwnPlaneGiveItsOwnRays) {
  const View flat = window_view();
  for (const Size size : {Size{64, 32}, Size{4, 3}}) {
    View view = flat;
    view.points =
        PixelPoints{std::make_shared<const PositionMap>(plane(size)), glm::dvec3(0.0), glm::dmat3(1.0), false, 1};
    for (int y = 0; y < view.size().height; y += 3) {
      for (int x = 0; x < view.size().width; x += 3) {
        const Ray expected = view_ray(flat, x + 0.5, y + 0.5);
        const Ray ray = view_ray(view, x + 0.5, y + 0.5);
        EXPECT_EQ(ray.origin, expected.origin);
        EXPECT_LT(glm::distance(ray.direction, expected.direction), 1e-7);
      }
    }
  }
}

TEST(PixelPoints, ARayWithoutAPointIsThatOfItsPixelsCentreThenOfThePlane) {
  Image<glm::vec3> points = plane({64, 32});
  for (glm::vec3& point : points.pixels()) point.x += 1.0F;
  points.at(21, 12) = glm::vec3(kNone);
  View view = window_view();
  view.points = PixelPoints{std::make_shared<const PositionMap>(points), glm::dvec3(0.0), glm::dmat3(1.0), false, 1};
  View still = view;
  still.jitter = glm::dvec2(0.0);
  // (20, 12) of the screen, whose jittered place needs its right neighbour.
  EXPECT_EQ(view_ray(view, 4.5, 4.5).direction, view_ray(still, 4.5, 4.5).direction);
  EXPECT_NE(view_ray(view, 3.5, 4.5).direction, view_ray(still, 3.5, 4.5).direction);
  EXPECT_EQ(view_ray(view, 5.5, 4.5).direction, view_ray(window_view(), 5.5, 4.5).direction);
}

}  // namespace
}  // namespace hpr
