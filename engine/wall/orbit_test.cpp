#include "engine/wall/orbit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "scene/view.h"

namespace hpr {
namespace {

constexpr Bounds kBounds{{-1.0, -1.0, -1.0}, {1.0, 1.0, 1.0}};

OrbitCamera from_the_front() {
  return {look_at({0.0, 0.0, 5.0}, {0.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, 0.8), kBounds};
}

void expect_near(const glm::dvec3& a, const glm::dvec3& b) {
  EXPECT_LT(glm::length(a - b), 1e-12) << a.x << " " << a.y << " " << a.z;
}

TEST(OrbitCamera, WithoutMotionNoBitChanges) {
  OrbitCamera orbit = from_the_front();
  const Camera before = orbit.camera();
  orbit.move({});
  EXPECT_EQ(orbit.camera().eye, before.eye);
  EXPECT_EQ(orbit.camera().axes, before.axes);
}

TEST(OrbitCamera, TurningTheSceneRightTakesTheCameraLeft) {
  OrbitCamera orbit = from_the_front();
  orbit.move({.turn_right = 0.5 * std::numbers::pi});
  expect_near(orbit.camera().eye, {-5.0, 0.0, 0.0});
  expect_near(orbit.camera().axes[0], {0.0, 0.0, 1.0});
  expect_near(orbit.camera().axes[1], {0.0, 1.0, 0.0});
}

TEST(OrbitCamera, TurningTheSceneUpTakesTheCameraDownAndStopsBeforeThePole) {
  OrbitCamera orbit = from_the_front();
  orbit.move({.turn_up = 0.5});
  expect_near(orbit.camera().eye, {0.0, -5.0 * std::sin(0.5), 5.0 * std::cos(0.5)});
  orbit.move({.turn_up = 100.0});
  EXPECT_LT(orbit.camera().eye.y, -4.9);
  EXPECT_GT(orbit.camera().axes[1].y, 0.0);
  EXPECT_GT(orbit.camera().axes[0].x, 0.99);  // never rolled over
}

TEST(OrbitCamera, PanningByAHeightMovesThePictureByIt) {
  OrbitCamera orbit = from_the_front();
  orbit.move({.pan_right = 1.0, .pan_up = 0.5});
  const double height = 2.0 * 5.0 * std::tan(0.4);
  expect_near(orbit.camera().eye, {-height, -0.5 * height, 5.0});
}

TEST(OrbitCamera, DollyGoesNearerAndNeverThrough) {
  OrbitCamera orbit = from_the_front();
  orbit.move({.dolly = std::log(2.0)});
  expect_near(orbit.camera().eye, {0.0, 0.0, 2.5});
  for (int i = 0; i < 10; ++i) orbit.move({.dolly = 1e9});
  EXPECT_GT(orbit.camera().eye.z, 0.0);
}

TEST(OrbitCamera, AnOrthographicCameraSeesLessInstead) {
  Camera camera = look_at({0.0, 0.0, 5.0}, {0.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, 0.8);
  camera.lens = OrthographicLens{.half_width = 2.0, .half_height = 1.0};
  OrbitCamera orbit(camera, kBounds);
  orbit.move({.dolly = std::log(2.0)});
  EXPECT_NEAR(std::get<OrthographicLens>(orbit.camera().lens).half_height, 0.5, 1e-12);
  expect_near(orbit.camera().eye, camera.eye);
}

TEST(OrbitCamera, AfterAThousandNotchesEitherWayThereIsAWayBack) {
  constexpr double kNotch = 0.15;
  Camera flat = look_at({0.0, 0.0, 5.0}, {0.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, 0.8);
  flat.lens = OrthographicLens{.half_width = 2.0, .half_height = 1.0};
  const auto seen = [](const OrbitCamera& orbit) {  // how much: by its distance, or its lens
    const auto* const lens = std::get_if<OrthographicLens>(&orbit.camera().lens);
    return lens != nullptr ? lens->half_height : orbit.camera().eye.z;
  };
  for (OrbitCamera orbit : {from_the_front(), OrbitCamera(flat, kBounds)}) {
    const double start = seen(orbit);
    for (const double way : {-kNotch, kNotch}) {
      for (int i = 0; i < 1000; ++i) orbit.move({.dolly = way});
      const double there = seen(orbit);
      EXPECT_TRUE(way < 0.0 ? there > 1e3 * start : there < 1e-3 * start) << there;
      int notches = 0;
      for (; (way < 0.0) == (seen(orbit) > start) && notches < 100; ++notches) orbit.move({.dolly = -way});
      EXPECT_LT(notches, 100);
    }
  }
}

}  // namespace
}  // namespace hpr
