#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <random>

#include "walls/config/wall_file.h"
#include "walls/geometry/geometry.h"
#include "walls/tracking/head_path.h"

namespace hpr {
namespace {

using Long = long double;
using LongPoint = glm::vec<3, Long>;

/// Left, right, bottom, top on the plane one metre before the eye.
struct Edges {
  Long left, right, bottom, top;
};

/// Kooima's formula, with nothing shared with the code under test.
Edges closed_formula(const WallScreen& screen, const LongPoint& eye) {
  const auto minus = [](const LongPoint& a, const LongPoint& b) { return LongPoint(a.x - b.x, a.y - b.y, a.z - b.z); };
  const auto dot = [](const LongPoint& a, const LongPoint& b) { return a.x * b.x + a.y * b.y + a.z * b.z; };
  const auto unit = [&](const LongPoint& a) {
    const Long length = std::sqrt(dot(a, a));
    return LongPoint(a.x / length, a.y / length, a.z / length);
  };
  const LongPoint pa(screen.lower_left);
  const LongPoint pb(screen.lower_right);
  const LongPoint pc(screen.upper_left);
  const LongPoint vr = unit(minus(pb, pa));
  const LongPoint vu = unit(minus(pc, pa));
  const LongPoint vn(vr.y * vu.z - vr.z * vu.y, vr.z * vu.x - vr.x * vu.z, vr.x * vu.y - vr.y * vu.x);
  const Long distance = -dot(vn, minus(pa, eye));
  return {dot(vr, minus(pa, eye)) / distance, dot(vr, minus(pb, eye)) / distance, dot(vu, minus(pa, eye)) / distance,
          dot(vu, minus(pc, eye)) / distance};
}

Camera straight() {
  Camera camera;
  camera.lens = PerspectiveLens{1.0, 0.1};
  return camera;
}

Wall stereo_wall(StereoMode mode) {
  Wall wall = load_wall("3x2@640x361");
  wall.stereo = mode;
  WallViewer& viewer = wall.viewers.front();
  viewer.has_position = true;
  viewer.position = {0.2, 0.1, 1.3};
  viewer.ipd_m = 0.063;
  viewer.eye_offset = {0.0, 0.02, -0.08};
  return wall;
}

TEST(Stereo, EachEyesFrustumIsTheClosedFormulaTo1e9) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> part(-1.0, 1.0);
  const Wall wall = stereo_wall(StereoMode::SideBySide);
  const std::vector<ScreenEye> pictures = screen_eyes(wall);
  for (int trial = 0; trial < 50; ++trial) {
    const HeadPose head{{0.5 * part(random), 0.4 * part(random), 1.0 + 0.5 * part(random)},
                        orientation_of(80.0 * part(random), 40.0 * part(random), 30.0 * part(random))};
    const std::vector<View> views = wall_views(wall, std::vector{head}, straight(), {});
    ASSERT_EQ(views.size(), pictures.size());
    for (std::size_t i = 0; i < views.size(); ++i) {
      // The head's axes by the sandwich product, written out.
      const Long w = head.orientation.w;
      const Long x = head.orientation.x;
      const Long y = head.orientation.y;
      const Long z = head.orientation.z;
      const Long side = pictures[i].eye == Eye::Left ? -0.5L : 0.5L;
      const LongPoint inside(side * 0.063L, 0.02L, -0.08L);
      const LongPoint eye(head.position.x + (1 - 2 * (y * y + z * z)) * inside.x + 2 * (x * y - w * z) * inside.y +
                              2 * (x * z + w * y) * inside.z,
                          head.position.y + 2 * (x * y + w * z) * inside.x + (1 - 2 * (x * x + z * z)) * inside.y +
                              2 * (y * z - w * x) * inside.z,
                          head.position.z + 2 * (x * z - w * y) * inside.x + 2 * (y * z + w * x) * inside.y +
                              (1 - 2 * (x * x + y * y)) * inside.z);
      const Edges expected = closed_formula(wall.screens[pictures[i].screen], eye);
      EXPECT_NEAR(views[i].left, static_cast<double>(expected.left), 1e-9);
      EXPECT_NEAR(views[i].right, static_cast<double>(expected.right), 1e-9);
      EXPECT_NEAR(views[i].bottom, static_cast<double>(expected.bottom), 1e-9);
      EXPECT_NEAR(views[i].top, static_cast<double>(expected.top), 1e-9);
      // The camera is where the head rests.
      const glm::dvec3 moved = glm::dvec3(eye) - wall.viewers.front().position;
      EXPECT_LT(glm::distance(views[i].eye, straight().eye + moved), 1e-9);
    }
  }
}

TEST(Stereo, TheEyesLieOnTheHeadsRightAxis) {
  WallViewer viewer;
  viewer.ipd_m = 0.06;
  viewer.eye_offset = {0.0, 0.0, -0.1};
  const HeadPose turned{{1.0, 2.0, 3.0}, orientation_of(90.0, 0.0, 0.0)};  // looks along -x
  EXPECT_LT(glm::distance(eye_position(viewer, turned, Eye::Left), {0.9, 2.0, 3.03}), 1e-12);
  EXPECT_LT(glm::distance(eye_position(viewer, turned, Eye::Right), {0.9, 2.0, 2.97}), 1e-12);
  EXPECT_LT(glm::distance(eye_position(viewer, turned, Eye::Both), {0.9, 2.0, 3.0}), 1e-12);
}

TEST(Stereo, AViewerPlacedByTheCameraHasTwoEyesToo) {
  Wall wall = load_wall("2x1");
  wall.stereo = StereoMode::Anaglyph;
  wall.viewers.front().ipd_m = 0.1;
  const std::vector<View> views = wall_views(wall, straight(), {});
  EXPECT_NEAR(views[0].eye.x, -0.05, 1e-12);
  EXPECT_NEAR(views[1].eye.x, 0.05, 1e-12);
  EXPECT_NEAR(views[0].eye.z, 0.0, 1e-12);
}

TEST(Stereo, TheClampHoldsForEachEyeByItself) {
  // The head turned so that the right eye is 1 mm behind the plane, and the left one 0.1 m before it.
  Wall wall = stereo_wall(StereoMode::Anaglyph);
  WallViewer& viewer = wall.viewers.front();
  viewer.ipd_m = 0.101;
  viewer.eye_offset = glm::dvec3(0.0);
  viewer.clamp_distance_m = 0.02;
  const HeadPose head{{0.0, 0.0, 0.0495}, orientation_of(90.0, 0.0, 0.0)};
  const std::vector<View> views = wall_views(wall, std::vector{head}, straight(), {});
  EXPECT_NEAR(views[0].right - views[0].left, screen_width(wall.screens[0]) / 0.1, 1e-9);
  EXPECT_NEAR(views[1].right - views[1].left, screen_width(wall.screens[0]) / 0.02, 1e-9);
}

TEST(Stereo, ASurfaceIsSeenByItsOwnViewer) {
  const WallReading reading = parse_wall(
      "hpr_wall = 1\n"
      "surfaces = [{ id = \"a\", grid = { columns = 1, rows = 1, tile_pixels = [64, 36], tile_size_m = [1.6, 0.9] } "
      "},\n"
      "  { id = \"b\", viewer = \"child\", grid = { columns = 1, rows = 1, tile_pixels = [64, 36], tile_size_m = [1.6, "
      "0.9], centre_m = [2, 0, 0] } }]\n"
      "viewers = [{ id = \"adult\", position_m = [0, 0, 2] }, { id = \"child\", position_m = [2, -0.4, 1], near_m = "
      "0.3 }]\n",
      "t.toml");
  ASSERT_TRUE(reading.findings.empty()) << reading.findings.front().what;
  const std::vector<View> views = wall_views(reading.wall, straight(), {});
  EXPECT_NEAR(views[0].top, 0.225, 1e-12);
  EXPECT_NEAR(views[1].top, 0.85, 1e-12);
  EXPECT_NEAR(views[1].right, 0.8, 1e-12);
  EXPECT_EQ(views[1].near_distance, 0.3);
  EXPECT_LT(glm::distance(views[1].eye, {2.0, -0.4, -1.0}), 1e-12);
}

TEST(Stereo, ScreensForBothEyesNeedTwoPicturesOnlyWhereTheyShareAPanel) {
  Wall wall = load_wall("2x1@9x5");
  wall.screens[1].eye = Eye::Right;
  EXPECT_EQ(screen_eyes(wall).size(), 2U);
  wall.stereo = StereoMode::Passive;
  EXPECT_EQ(screen_eyes(wall).size(), 2U);
  wall.stereo = StereoMode::SideBySide;
  EXPECT_EQ(screen_eyes(wall),
            (std::vector<ScreenEye>{{0, Eye::Left, {4, 5}}, {0, Eye::Right, {5, 5}}, {1, Eye::Right, {9, 5}}}));
  wall.stereo = StereoMode::TopBottom;
  EXPECT_EQ(screen_eyes(wall)[1], (ScreenEye{0, Eye::Right, {9, 3}}));
  wall.stereo = StereoMode::Anaglyph;
  EXPECT_EQ(screen_eyes(wall)[0], (ScreenEye{0, Eye::Left, {9, 5}}));
  for (const StereoMode mode : {StereoMode::SideBySide, StereoMode::TopBottom}) {
    wall.stereo = mode;
    for (const ScreenEye& picture : screen_eyes(scale_wall(wall, 1e-6))) EXPECT_GT(picture.pixels.area(), 0U);
  }
}

TEST(Stereo, PicturesAreComposedPixelByPixel) {
  const Image<Rgba8> red({2, 3}, {200, 1, 2, 255});
  const Image<Rgba8> green({3, 3}, {3, 210, 4, 255});
  const Image<Rgba8> beside = compose_eyes(StereoMode::SideBySide, red, green);
  EXPECT_EQ(beside.size(), (Size{5, 3}));
  EXPECT_EQ(beside.at(1, 2), red.at(0, 0));
  EXPECT_EQ(beside.at(2, 0), green.at(0, 0));
  const Image<Rgba8> blue({2, 1}, {5, 6, 220, 255});
  const Image<Rgba8> above = compose_eyes(StereoMode::TopBottom, red, blue);
  EXPECT_EQ(above.size(), (Size{2, 4}));
  EXPECT_EQ(above.at(1, 2), red.at(0, 0));
  EXPECT_EQ(above.at(0, 3), blue.at(0, 0));
  const Image<Rgba8> cyan({2, 3}, {9, 100, 101, 255});
  EXPECT_EQ(compose_eyes(StereoMode::Anaglyph, red, cyan).at(1, 1), (Rgba8{200, 100, 101, 255}));
}

TEST(Stereo, ScreensAreComposedInOrderAndMissingOnesStayEmpty) {
  Wall wall = load_wall("3x1@4x2");
  wall.stereo = StereoMode::SideBySide;
  wall.screens[1].eye = Eye::Left;
  const auto filled = [](Size size, std::uint8_t value) { return Image<Rgba8>(size, {value, value, value, 255}); };
  const std::vector<Image<Rgba8>> screens =
      compose_screens(wall, {filled({2, 2}, 1), filled({2, 2}, 2), filled({4, 2}, 3), Image<Rgba8>(), Image<Rgba8>()});
  ASSERT_EQ(screens.size(), 3U);
  EXPECT_EQ(screens[0].at(1, 1).r, 1);
  EXPECT_EQ(screens[0].at(2, 1).r, 2);
  EXPECT_EQ(screens[1], filled({4, 2}, 3));
  EXPECT_EQ(screens[2].size().area(), 0U);
}

}  // namespace
}  // namespace hpr
