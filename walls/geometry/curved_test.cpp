#include "walls/geometry/curved.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>

#include "walls/geometry/geometry.h"
#include "walls/geometry/warp_test_tools.h"

namespace hpr {
namespace {

using test::Arc;

WallScreen arc_screen(const Arc& arc, Size pixels, Size texels) {
  WallScreen screen;
  screen.id = "arc";
  screen.pixels = pixels;
  screen.lower_left = arc.at(0.0, 1.0);
  screen.lower_right = arc.at(1.0, 1.0);
  screen.upper_left = arc.at(0.0, 0.0);
  screen.warp.mesh.path = "arc.pfm";
  screen.warp.points = std::make_shared<const PositionMap>(arc.points(texels));
  return screen;
}

Wall arc_wall(const std::vector<Arc>& arcs, Size pixels, Size texels, const glm::dvec3& eye) {
  Wall wall;
  for (const Arc& arc : arcs) wall.screens.push_back(arc_screen(arc, pixels, texels));
  wall.viewers.front().has_position = true;
  wall.viewers.front().position = eye;
  return wall;
}

/// The camera that leaves a wall with a viewer at `eye` where it is.
Camera at(const glm::dvec3& eye) {
  Camera camera;
  camera.eye = eye;
  return camera;
}

Image<Rgba8> draw(const View& view, const std::function<double(const glm::dvec3& direction)>& light) {
  Image<Rgba8> picture(view.size());
  for (int y = 0; y < picture.height(); ++y) {
    for (int x = 0; x < picture.width(); ++x) {
      const auto value = static_cast<float>(light(view_ray(view, x + 0.5, y + 0.5).direction));
      picture.at(x, y) = to_srgb({value, value, value});
    }
  }
  return picture;
}

/// What the screens show of a scene of light from far away, drawn flat.
std::vector<Image<Rgba8>> shown_flat(const std::vector<View>& views,
                                     const std::function<double(const glm::dvec3& direction)>& light) {
  CurvedScreens curved(views, false);
  std::vector<Image<Rgba8>> pictures;
  for (const View& view : curved.drawn(views)) pictures.push_back(draw(view, light));
  curved.finish(views, pictures, 2);
  return pictures;
}

/// Rows at which a straight line in space is seen on an arc: the plane through it and the eye cuts each column once.
struct Line {
  glm::dvec3 eye;
  glm::dvec3 normal;  ///< of that plane

  [[nodiscard]] double row(const Arc& arc, Size pixels, int x) const {
    const glm::dvec3 foot = arc.at((x + 0.5) / pixels.width, 1.0);
    const glm::dvec3 from = foot - eye;
    const double height = arc.bottom - glm::dot(normal, from) / normal.y;
    return (arc.top - height) / (arc.top - arc.bottom) * pixels.height;
  }
};

constexpr Size kPixels{320, 240};
const glm::dvec3 kEye(0.4, 1.3, 0.5);

Line some_line() {
  const glm::dvec3 from(-9.0, -0.5, -8.0);
  const glm::dvec3 to(7.0, 4.0, -11.0);
  return {kEye, glm::normalize(glm::cross(from - kEye, to - kEye))};
}

TEST(CurvedScreens, AStraightLineDrawnFlatLandsOnTheRightPixelsOfACylinder) {
  const Arc arc;
  const Line line = some_line();
  for (const Size texels : {kPixels, Size{80, 60}}) {
    const Wall wall = arc_wall({arc}, kPixels, texels, kEye);
    const std::vector<View> views = wall_views(wall, at(kEye), {});
    const auto light = [&](const glm::dvec3& direction) {
      const double degrees_off = glm::dot(line.normal, glm::normalize(direction)) * 57.3;
      return std::exp(-degrees_off * degrees_off / (2.0 * 0.5 * 0.5));
    };
    const Image<Rgba8> shown = shown_flat(views, light).front();
    double worst = 0.0;
    for (int x = 0; x < kPixels.width; ++x) {
      double sum = 0.0;
      double moment = 0.0;
      const double expected = line.row(arc, kPixels, x);
      ASSERT_GT(expected, 15.0);
      ASSERT_LT(expected, kPixels.height - 15.0);
      for (int y = static_cast<int>(expected) - 12; y <= static_cast<int>(expected) + 12; ++y) {
        const auto value = static_cast<double>(srgb_to_linear(shown.at(x, y).g));
        sum += value;
        moment += value * (y + 0.5);
      }
      worst = std::max(worst, std::abs(moment / sum - expected));
    }
    EXPECT_LT(worst, 0.1) << texels.width << " texels";
  }
}

TEST(CurvedScreens, RaysThroughACylinderMeetAStraightLineOnTheRightPixels) {
  const Arc arc;
  const Line line = some_line();
  const View view = wall_views(arc_wall({arc}, kPixels, kPixels, kEye), at(kEye), {}).front();
  for (int x = 0; x < kPixels.width; ++x) {
    const double row = line.row(arc, kPixels, x);
    const double above = glm::dot(line.normal, view_ray(view, x + 0.5, row - 0.1).direction);
    const double below = glm::dot(line.normal, view_ray(view, x + 0.5, row + 0.1).direction);
    EXPECT_LT(above * below, 0.0) << x;
  }
}

/// Smooth, and nowhere even.
double waves(const glm::dvec3& direction) {
  const glm::dvec3 d = glm::normalize(direction);
  return 0.5 + 0.24 * std::sin(9.0 * d.x + 4.0 * d.y) + 0.24 * std::cos(8.0 * d.z - 11.0 * d.y);
}

TEST(CurvedScreens, TwoScreensOfACylinderContinueEachOther) {
  // 0.25 degrees a pixel: the last 40 columns of one lie where the first of the other do.
  constexpr Size kHalf{200, 120};
  constexpr int kShared = 40;
  const Wall wall = arc_wall({Arc{.left = -45.0, .right = 5.0}, Arc{.left = -5.0, .right = 45.0}}, kHalf, kHalf, kEye);
  const std::vector<View> views = wall_views(wall, at(kEye), {});
  const std::vector<Image<Rgba8>> shown = shown_flat(views, waves);
  int darkest = 255;
  int brightest = 0;
  for (int y = 0; y < kHalf.height; ++y) {
    for (int x = 0; x < kShared; ++x) {
      const int left = shown[0].at(kHalf.width - kShared + x, y).g;
      const int right = shown[1].at(x, y).g;
      EXPECT_LE(std::abs(left - right), 1) << x << ", " << y;
      darkest = std::min(darkest, left);
      brightest = std::max(brightest, left);
      const glm::dvec3 a = view_ray(views[0], kHalf.width - kShared + x + 0.5, y + 0.5).direction;
      const glm::dvec3 b = view_ray(views[1], x + 0.5, y + 0.5).direction;
      EXPECT_LT(glm::distance(glm::normalize(a), glm::normalize(b)), 1e-6);
    }
  }
  EXPECT_GT(brightest - darkest, 50);
}

TEST(CurvedScreens, FlatPicturesHoldAllThatIsSeenAndAreFineEnough) {
  for (const glm::dvec3 eye : {kEye, glm::dvec3(-1.0, 2.5, -0.5)}) {
    const View view = wall_views(arc_wall({Arc{}}, kPixels, {9, 7}, eye), at(eye), {}).front();
    const Size pixels = flat_pixels(view);
    EXPECT_GE(pixels.width, kPixels.width);
    EXPECT_LE(pixels.width, 2 * kPixels.width);
    const View flat = flat_view(view, pixels);
    const double across = (flat.right - flat.left) / pixels.width;
    double least = 1.0;
    for (int x = 0; x + 1 < kPixels.width; ++x) {
      for (int y = 0; y < kPixels.height; y += 7) {
        const auto here = view.points->seen_at((x + 0.5) / kPixels.width, (y + 0.5) / kPixels.height);
        const auto beside = view.points->seen_at((x + 1.5) / kPixels.width, (y + 0.5) / kPixels.height);
        ASSERT_TRUE(here && beside);
        least = std::min(least, beside->x - here->x);
        EXPECT_TRUE(here->x >= flat.left && here->x <= flat.right && here->y >= flat.bottom && here->y <= flat.top);
      }
    }
    EXPECT_LT(across, 1.05 * least);
    const Image<SourcePosition> sources = curved_sources(view, flat, 3);
    EXPECT_EQ(std::ranges::count(sources.pixels(), kNoSource), 0);
    EXPECT_EQ(sources, curved_sources(view, flat, 1));
  }
}

TEST(CurvedScreens, PointsOnTheScreensOwnPlaneChangeNothing) {
  Wall wall = arc_wall({Arc{}}, {64, 48}, {64, 48}, kEye);
  WallScreen& screen = wall.screens.front();
  screen.warp.points.reset();
  const View plain = wall_views(wall, at(kEye), {}).front();
  Image<glm::vec3> points(screen.pixels);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      points.at(x, y) = screen.upper_left + (screen.lower_right - screen.lower_left) * ((x + 0.5) / 64) +
                        (screen.lower_left - screen.upper_left) * ((y + 0.5) / 48);
    }
  }
  screen.warp.points = std::make_shared<const PositionMap>(points);
  const std::vector<View> views = wall_views(wall, at(kEye), {});
  CurvedScreens curved(views, false);
  EXPECT_EQ(curved.sizes().front(), (Size{64, 48}));
  const View flat = curved.drawn(views).front();
  EXPECT_FALSE(flat.points);
  EXPECT_NEAR(flat.left, plain.left, 1e-6);
  EXPECT_NEAR(flat.top, plain.top, 1e-6);
  std::vector<Image<Rgba8>> pictures{draw(plain, waves)};
  const Image<Rgba8> before = pictures.front();
  curved.finish(views, pictures, 1);
  for (std::size_t i = 0; i < before.pixels().size(); ++i) {
    EXPECT_LE(std::abs(pictures.front().pixels()[i].g - before.pixels()[i].g), 1);
  }
}

TEST(CurvedScreens, WhatHasNoPointIsDarkHoweverItIsDrawn) {
  Image<glm::vec3> points = Arc{}.points({32, 24});
  for (int y = 0; y < 24; ++y) points.at(31, y) = glm::vec3(std::numeric_limits<float>::quiet_NaN());
  Wall wall = arc_wall({Arc{}}, {32, 24}, {32, 24}, kEye);
  wall.screens.front().warp.points = std::make_shared<const PositionMap>(points);
  const std::vector<View> views = wall_views(wall, at(kEye), {});
  for (const bool by_rays : {false, true}) {
    CurvedScreens curved(views, by_rays);
    EXPECT_EQ(curved.drawn(views).front().points.has_value(), by_rays);
    std::vector<Image<Rgba8>> pictures{Image<Rgba8>(curved.sizes().front(), {9, 200, 77, 255})};
    curved.finish(views, pictures, 2);
    ASSERT_EQ(pictures.front().size(), (Size{32, 24}));
    for (int y = 0; y < 24; ++y) {
      EXPECT_EQ(pictures.front().at(31, y), (Rgba8{0, 0, 0, 255}));
      EXPECT_EQ(pictures.front().at(30, y), (Rgba8{9, 200, 77, 255}));
    }
  }
}

TEST(CurvedScreens, FollowAnEyeThatMoves) {
  const Wall wall = arc_wall({Arc{}}, {64, 48}, {32, 24}, kEye);
  const std::vector<View> rest = wall_views(wall, at(kEye), {});
  CurvedScreens curved(rest, false);
  for (const glm::dvec3 head : {kEye, kEye + glm::dvec3(0.5, 0.2, -0.3), kEye}) {
    const std::vector<HeadPose> heads{{head}};
    const std::vector<View> views = wall_views(wall, heads, at(kEye), {});
    std::vector<Image<Rgba8>> pictures{draw(curved.drawn(views).front(), waves)};
    curved.finish(views, pictures, 1);
    const Image<Rgba8> exact = draw(views.front(), waves);  // through the points themselves
    for (std::size_t i = 0; i < exact.pixels().size(); ++i) {
      EXPECT_LE(std::abs(pictures.front().pixels()[i].g - exact.pixels()[i].g), 4) << i;
    }
  }
}

TEST(CurvedScreens, FollowACameraThatTakesARestingEyeAlong) {
  const Wall wall = arc_wall({Arc{}}, {64, 48}, {32, 24}, kEye);
  CurvedScreens curved(wall_views(wall, at(kEye), {}), false);
  const View here = curved.drawn(wall_views(wall, at(kEye), {})).front();
  const View there = curved.drawn(wall_views(wall, at(kEye + glm::dvec3(7.0, 0.0, 0.0)), {})).front();
  EXPECT_EQ(there.eye, here.eye + glm::dvec3(7.0, 0.0, 0.0));
  EXPECT_EQ(there.right, here.right);
}

TEST(CurvedScreens, AnEyeBetweenTheCornersAndTheScreenStaysWhereItIs) {
  const Arc arc{.left = -60.0, .right = 60.0};  // its corners' plane is z = -1.5
  const glm::dvec3 eye(0.1, 1.4, -1.8);
  const View view = wall_views(arc_wall({arc}, {64, 48}, {64, 48}, eye), at(eye), {}).front();
  EXPECT_EQ(view.eye, eye);
  for (int x = 9; x < 60; x += 9) {  // the outermost lie behind the eye
    const glm::dvec3 point = arc.at((x + 0.5) / 64, 10.5 / 48);
    const Ray ray = view_ray(view, x + 0.5, 10.5);
    EXPECT_LT(glm::distance(glm::normalize(ray.direction), glm::normalize(point - eye)), 1e-6) << x;
  }
}

TEST(CurvedScreens, ParallelRaysOfACameraGoThroughThePointsToo) {
  Wall wall = arc_wall({Arc{}}, {64, 48}, {64, 48}, kEye);
  Camera camera = at(kEye);
  camera.lens = OrthographicLens{2.0, 2.0, 0.5, 40.0};
  const View view = wall_views(wall, camera, {}).front();
  ASSERT_TRUE(view.points);
  const double scale = 4.0 / wall_extent(wall).height;
  const glm::dvec3 point = Arc{}.at(10.5 / 64, 20.5 / 48);
  const Ray ray = view_ray(view, 10.5, 20.5);
  EXPECT_LT(glm::distance(glm::dvec2(ray.origin), glm::dvec2(kEye) + scale * glm::dvec2(point - kEye)), 1e-5);
  EXPECT_LT(glm::distance(ray.direction, glm::dvec3(0.0, 0.0, -1.0)), 1e-9);
}

}  // namespace
}  // namespace hpr
