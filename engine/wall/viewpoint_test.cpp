#include "engine/wall/viewpoint.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "core/error.h"
#include "scene/view.h"
#include "walls/displays/display.h"

namespace hpr {
namespace {

constexpr const char* kPath = R"(# three keys
eye 0,1,5 at 0,1,0
  eye 1,1,5 at 0,1,0 up 0,1,0 fov 60   # the second

eye 1,1e0,-5 at 0,1,0 fov 30
)";

TEST(CameraPath, ReadsKeysLineByLine) {
  const CameraPath path = parse_camera_path(kPath, "walk");
  ASSERT_EQ(path.keys().size(), 3U);
  EXPECT_EQ(path.keys()[1].eye, glm::dvec3(1, 1, 5));
  EXPECT_EQ(path.keys()[1].fov_degrees, 60.0);
  EXPECT_EQ(path.keys()[2].eye, glm::dvec3(1, 1, -5));
  EXPECT_EQ(path.keys()[0].fov_degrees, 45.0);
  EXPECT_EQ(path.keys()[0].up, glm::dvec3(0, 1, 0));
}

TEST(CameraPath, PassesThroughItsKeys) {
  const CameraPath path = parse_camera_path(kPath, "walk");
  EXPECT_EQ(path.at_frame(0, 9).eye, path.keys()[0].eye);
  EXPECT_EQ(path.at_frame(4, 9).eye, path.keys()[1].eye);
  EXPECT_EQ(path.at_frame(8, 9).eye, path.keys()[2].eye);
  EXPECT_EQ(path.at_frame(0, 1).eye, path.keys()[0].eye);
  const double between = path.at_frame(2, 9).eye.x;
  EXPECT_GT(between, 0.4);
  EXPECT_LT(between, 0.8);
}

TEST(CameraPath, KeysOnALineAtEqualStepsMakeAnEvenWay) {
  std::vector<CameraKey> keys(5);
  for (std::size_t i = 0; i < keys.size(); ++i) keys[i].eye.x = static_cast<double>(i);
  const CameraPath path(keys);
  for (std::size_t frame = 10; frame <= 30; ++frame) {  // ends have no neighbour to fly on to
    EXPECT_NEAR(path.at_frame(frame, 41).eye.x, 0.1 * static_cast<double>(frame), 1e-12);
  }
}

TEST(CameraPath, RestsBetweenEqualKeys) {
  const CameraPath path =
      parse_camera_path("eye 0,0,9 at 0,0,0\neye 0,0,5 at 0,0,0\neye 0,0,5 at 0,0,0\neye 3,0,5 at 0,0,0\n", "rest");
  for (std::size_t frame = 10; frame <= 20; ++frame) {
    EXPECT_EQ(path.at_frame(frame, 31).eye, glm::dvec3(0, 0, 5)) << frame;
  }
  EXPECT_NE(path.at_frame(9, 31).eye, glm::dvec3(0, 0, 5));
}

TEST(CameraPath, NamesTheLineThatIsWrong) {
  for (const char* const line :
       {"eye 0,1,5", "at 0,0,0", "eye 0,1 at 0,0,0", "eye 0,1,5 at 0,0,nan", "eye 0,1,5 at 0,0,0 fov 180",
        "eye 0,1,5 at 0,0,0 fov", "eye 0,1,5 at 0,0,0 roll 3", "eye 1,1,1 at 1,1,1", "eye 0,0,5 at 0,0,0 up 0,0,1",
        "eye 0,1,5,6 at 0,0,0", "0 1 5 0 0 0"}) {
    try {
      (void)parse_camera_path(std::string("eye 0,0,1 at 0,0,0\n") + line, "walk");
      ADD_FAILURE() << "took '" << line << "'";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::BadInput) << line;
      EXPECT_NE(std::string(error.what()).find("walk:2:"), std::string::npos) << error.what();
    }
  }
  EXPECT_THROW((void)parse_camera_path("# nothing\n\n", "empty"), Error);
}

TEST(CameraPath, MayBeginWithAByteOrderMark) {
  EXPECT_EQ(parse_camera_path("\xEF\xBB\xBF"
                              "eye 0,0,1 at 0,0,0\n",
                              "walk")
                .keys()
                .size(),
            1U);
}

TEST(CameraPath, ThroughItsTargetIsFoundBeforeAnyFrameIsDrawn) {
  const CameraPath path = parse_camera_path("eye 0,1,4 at 0,1,0\neye 0,1,-4 at 0,1,0\n", "walk");
  EXPECT_NO_THROW(check_directions(path, 2, "walk"));
  try {
    check_directions(path, 3, "walk");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::BadInput);
    EXPECT_NE(std::string(error.what()).find("walk: frame 2 of 3"), std::string::npos) << error.what();
  }
}

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
    for (const double direction : {-kNotch, kNotch}) {
      for (int i = 0; i < 1000; ++i) orbit.move({.dolly = direction});
      const double there = seen(orbit);
      EXPECT_TRUE(direction < 0.0 ? there > 1e3 * start : there < 1e-3 * start) << there;
      int notches = 0;
      for (; (direction < 0.0) == (seen(orbit) > start) && notches < 100; ++notches) orbit.move({.dolly = -direction});
      EXPECT_LT(notches, 100);
    }
  }
}

}  // namespace

}  // namespace hpr
