#include "scene/view.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <numbers>
#include <vector>

#include "core/error.h"

namespace hpr {
namespace {

View turned_view(bool orthographic) {
  Camera camera = look_at({3, 2, 7}, {-1, 0.5, 0}, {0.1, 1, 0}, 0.9);
  if (orthographic) camera.lens = OrthographicLens{3.0, 2.0, 0.5, 40.0};
  View view = make_view(camera, {333, 217}, {{-5, -5, -5}, {5, 5, 5}});
  view.left *= 0.3;  // off-axis, as a screen of a wall is
  view.top *= 1.7;
  return view;
}

/// Where a world point lands, in pixels of the view from its upper left corner, and its depth.
glm::dvec3 project(const View& view, const glm::dvec3& point, const glm::dvec3& origin) {
  const glm::dvec4 clip = clip_from_world(view, origin) * glm::dvec4(point - origin, 1.0);
  const glm::dvec3 ndc = glm::dvec3(clip) / clip.w;
  return {(0.5 + 0.5 * ndc.x) * view.size().width, (0.5 - 0.5 * ndc.y) * view.size().height, ndc.z};
}

TEST(View, APointOnAPixelsRayProjectsToThatPixelAndItsDepth) {
  for (const bool orthographic : {false, true}) {
    for (const View& view : split_into_blocks(turned_view(orthographic), 128)) {
      for (const glm::dvec3 origin : {glm::dvec3(0.0), view.eye, glm::dvec3(100, -50, 3)}) {
        for (const double x : {0.0, 0.5, 17.25, 60.0}) {
          for (const double y : {0.0, 3.5, 40.0}) {
            const Ray ray = view_ray(view, x, y);
            for (const double distance : {0.6, 2.0, 39.0}) {
              const glm::dvec3 seen = project(view, ray.origin + distance * ray.direction, origin);
              EXPECT_NEAR(seen.x, x, 1e-9);
              EXPECT_NEAR(seen.y, y, 1e-9);
              EXPECT_NEAR(seen.z, reversed_depth(view, distance), 1e-12);
            }
          }
        }
      }
    }
  }
}

TEST(View, ADirectionIsOneMetreAlongTheAxis) {
  for (const bool orthographic : {false, true}) {
    const View view = turned_view(orthographic);
    EXPECT_NEAR(glm::dot(view_ray(view, 12.5, 200.5).direction, -view.axes[2]), 1.0, 1e-14);
  }
}

TEST(View, DepthIsReversed) {
  const View perspective = turned_view(false);
  EXPECT_EQ(reversed_depth(perspective, perspective.near_distance), 1.0);
  EXPECT_LT(reversed_depth(perspective, 1e12), 1e-9);
  EXPECT_GT(reversed_depth(perspective, 1e12), 0.0);
  const View box = turned_view(true);
  EXPECT_EQ(reversed_depth(box, box.near_distance), 1.0);
  EXPECT_EQ(reversed_depth(box, box.far_distance), 0.0);
}

TEST(View, DepthsTellTheDistance) {
  for (const bool orthographic : {false, true}) {
    const View view = turned_view(orthographic);
    for (const double distance : {0.5, 1.0, 39.0}) {
      EXPECT_NEAR(view_distance(view, reversed_depth(view, distance)), distance, 1e-13 * 40.0);
    }
  }
}

TEST(View, RowZeroIsTheTop) {
  const View view = make_view(look_at({0, 0, 5}, {0, 0, 0}, {0, 1, 0}, 0.5 * std::numbers::pi), {200, 100}, {});
  const glm::dvec3 upper_left = view_ray(view, 0, 0).direction;
  EXPECT_NEAR(glm::distance(upper_left, glm::dvec3(-2, 1, -1)), 0.0, 1e-14);
  EXPECT_NEAR(glm::distance(view_ray(view, 100, 50).direction, glm::dvec3(0, 0, -1)), 0.0, 1e-14);
}

TEST(View, BlocksAreThePixelsOfTheWholeAndTheirRaysAreTheSameBits) {
  for (const bool orthographic : {false, true}) {
    const View whole = turned_view(orthographic);
    Image<int> covered(whole.screen, 0);
    for (const View& block : split_into_blocks(whole, 64)) {
      EXPECT_LE(block.size().width, 64);
      EXPECT_LE(block.size().height, 64);
      for (int y = 0; y < block.size().height; ++y) {
        for (int x = 0; x < block.size().width; ++x) {
          ++covered.at(block.block.x0 + x, block.block.y0 + y);
          const Ray part = view_ray(block, x + 0.5, y + 0.5);
          const Ray all = view_ray(whole, block.block.x0 + x + 0.5, block.block.y0 + y + 0.5);
          ASSERT_TRUE(part.origin == all.origin && part.direction == all.direction);
        }
      }
    }
    for (const int count : covered.pixels()) ASSERT_EQ(count, 1);
  }
}

TEST(View, AJitteredViewSamplesOtherPositionsOfTheSamePixels) {
  for (const bool orthographic : {false, true}) {
    const View plain = turned_view(orthographic);
    View jittered = plain;
    jittered.jitter = {0.3125, -0.4375};  // to the right and up, exact in binary
    const Ray ray = view_ray(jittered, 20.5, 30.5);
    const Ray same = view_ray(plain, 20.8125, 30.0625);
    EXPECT_TRUE(ray.origin == same.origin && ray.direction == same.direction);
    for (const View& view : split_into_blocks(jittered, 128)) {
      const Ray seen = view_ray(view, 20.5, 30.5);
      const glm::dvec3 position = project(view, seen.origin + 2.0 * seen.direction, {100, -50, 3});
      EXPECT_NEAR(position.x, 20.5, 1e-9);
      EXPECT_NEAR(position.y, 30.5, 1e-9);
    }
  }
}

TEST(View, BlocksKeepTheirScreensNumberAndJitter) {
  View view = turned_view(false);
  view.screen_number = 7;
  view.jitter = {0.25, 0.125};
  for (const View& block : split_into_blocks(view, 64)) {
    EXPECT_EQ(block.screen_number, 7U);
    EXPECT_EQ(block.jitter, view.jitter);
  }
}

TEST(View, ABlockThatFitsStaysOne) {
  View view = turned_view(false);
  EXPECT_EQ(split_into_blocks(view, kRasterLimit).size(), 1U);
  EXPECT_EQ(split_into_blocks(view, kRasterLimit)[0].block, view.block);
  view.block = {64, 0, 192, 217};
  const auto blocks = split_into_blocks(view, 128);
  ASSERT_EQ(blocks.size(), 2U);
  EXPECT_EQ(blocks[1].block, (Rect{64, 128, 192, 217}));
}

TEST(View, TheLensKeepsItsHeightAndTheAspectGivesTheWidth) {
  const Camera camera = look_at({0, 0, 5}, {0, 0, 0}, {0, 1, 0}, 1.0);
  for (const Size size : {Size{100, 100}, Size{300, 100}, Size{100, 300}}) {
    const View view = make_view(camera, size, {});
    EXPECT_DOUBLE_EQ(view.top, std::tan(0.5));
    EXPECT_DOUBLE_EQ(view.right / view.top, static_cast<double>(size.width) / size.height);
    EXPECT_EQ(view.left, -view.right);
    EXPECT_EQ(view.bottom, -view.top);
  }
}

TEST(View, TheNearPlaneFollowsTheSceneUnlessTheCameraSaysSo) {
  Camera camera = look_at({0, 0, 5}, {0, 0, 0}, {0, 1, 0}, 1.0);
  EXPECT_DOUBLE_EQ(make_view(camera, {8, 8}, {{0, 0, 0}, {3, 4, 0}}).near_distance, 5e-4);
  EXPECT_GT(make_view(camera, {8, 8}, {}).near_distance, 0.0);
  EXPECT_DOUBLE_EQ(make_view(camera, {8, 8}, {{0, 0, 0}, {3e5, 4e5, 0}}).near_distance, 0.05) << "under a sky dome";
  camera = framing_camera({{0, 0, 0}, {3, 4, 0}});
  EXPECT_DOUBLE_EQ(make_view(camera, {8, 8}, {{0, 0, 0}, {3, 4, 0}}).near_distance, 5e-4);
  camera.lens = PerspectiveLens{1.0, 0.25};
  EXPECT_EQ(make_view(camera, {8, 8}, {{0, 0, 0}, {3, 4, 0}}).near_distance, 0.25);
}

TEST(LookAt, AxesAreOrthonormalAndRightHanded) {
  const Camera camera = look_at({1e6, 2, 3}, {-4, 5e5, 6}, {0.3, 1, 0}, 1.0);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) EXPECT_NEAR(glm::dot(camera.axes[i], camera.axes[j]), i == j ? 1.0 : 0.0, 1e-14);
  }
  EXPECT_GT(glm::dot(glm::cross(camera.axes[0], camera.axes[1]), camera.axes[2]), 0.0);
  EXPECT_GT(camera.axes[1].y, 0.0);
}

TEST(LookAt, RefusesWhatHasNoDirection) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [](const glm::dvec3& eye, const glm::dvec3& at, const glm::dvec3& up) {
    try {
      (void)look_at(eye, at, up, 1.0);
    } catch (const Error& error) {
      return error.code() == ExitCode::Usage;
    }
    return false;
  };
  EXPECT_TRUE(refused({1, 2, 3}, {1, 2, 3}, {0, 1, 0}));
  EXPECT_TRUE(refused({0, 5, 0}, {0, 0, 0}, {0, 1, 0}));
  EXPECT_TRUE(refused({0, 0, 5}, {0, 0, 0}, {0, 0, 0}));
  EXPECT_TRUE(refused({kNan, 0, 5}, {0, 0, 0}, {0, 1, 0}));
  EXPECT_TRUE(refused({std::numeric_limits<double>::infinity(), 0, 5}, {0, 0, 0}, {0, 1, 0}));
  EXPECT_FALSE(refused({0, 0, 1e-30}, {0, 0, 0}, {0, 1, 0})) << "small is not nothing";
}

TEST(FramingCamera, SeesAllOfTheBounds) {
  for (const Bounds& bounds :
       {Bounds{{-1, -1, -1}, {1, 1, 1}}, Bounds{{1e6, 0, 0}, {1e6 + 10, 0.1, 3}}, Bounds{{5, 5, 5}, {5, 5, 5}}}) {
    const View view = make_view(framing_camera(bounds), {100, 100}, bounds);
    for (int corner = 0; corner < 8; ++corner) {
      const glm::dvec3 point((corner & 1) != 0 ? bounds.high.x : bounds.low.x,
                             (corner & 2) != 0 ? bounds.high.y : bounds.low.y,
                             (corner & 4) != 0 ? bounds.high.z : bounds.low.z);
      const glm::dvec3 seen = project(view, point, view.eye);
      EXPECT_GE(seen.x, 0.0);
      EXPECT_LE(seen.x, 100.0);
      EXPECT_GE(seen.y, 0.0);
      EXPECT_LE(seen.y, 100.0);
      EXPECT_GT(seen.z, 0.0);
      EXPECT_LT(seen.z, 1.0);
    }
  }
}

/// Where in a picture of 100 x 100 a scene's surfaces end: left, top, right, bottom.
std::array<double, 4> framed(const Scene& scene) {
  const View view = make_view(framing_camera(scene), {100, 100}, scene.bounds);
  std::array<double, 4> edges{100.0, 100.0, 0.0, 0.0};
  for (const Instance& instance : scene.instances) {
    for (const glm::vec3& position : scene.mesh_of(instance).positions) {
      const glm::dvec3 seen = project(view, glm::dvec3(instance.to_world * glm::dvec4(position, 1.0)), view.eye);
      edges = {std::min(edges[0], seen.x), std::min(edges[1], seen.y), std::max(edges[2], seen.x),
               std::max(edges[3], seen.y)};
    }
  }
  return edges;
}

/// Points along a coil of radius 1 about y, as triangles of no interest.
Scene coil_of(const glm::dvec3& scale, const glm::dvec3& offset) {
  Scene scene;
  scene.materials.emplace_back();
  Mesh mesh;
  for (int i = 0; i < 300; ++i) {
    mesh.positions.emplace_back(std::cos(0.1 * i), 0.01 * i - 1.5, std::sin(0.1 * i));
    mesh.normals.emplace_back(0.0F, 1.0F, 0.0F);
  }
  for (unsigned i = 0; i + 2 < 300; ++i) mesh.triangles.emplace_back(i, i + 1, i + 2);
  scene.meshes.push_back(std::move(mesh));
  Instance instance;
  instance.to_world = glm::scale(glm::translate(glm::dmat4(1.0), offset), scale);
  scene.instances.push_back(instance);
  finish_scene(scene);
  return scene;
}

TEST(FramingCamera, IsAsNearAsWhatIsThereAllows) {
  for (const glm::dvec3& scale : {glm::dvec3(1.0), glm::dvec3(1e-6), glm::dvec3(5.0, 1.0, 1.0),
                                  glm::dvec3(1.0, 4.0, 2.0), glm::dvec3(3.0, 0.01, 3.0), glm::dvec3(1e-3, 1.0, 1.0)}) {
    const std::array<double, 4> edges = framed(coil_of(scale, {7.0, -3.0, 1e3}));
    // A margin of a twentieth, alike on the two sides that the picture is filled to.
    const double beside = std::min(edges[0], 100.0 - edges[2]);
    const double above = std::min(edges[1], 100.0 - edges[3]);
    EXPECT_NEAR(std::min(beside, above), 50.0 - 50.0 / 1.05, 0.1);
    const bool fills_width = beside < above;
    EXPECT_NEAR(fills_width ? edges[0] : edges[1], 100.0 - (fills_width ? edges[2] : edges[3]), 0.1);
  }
}

TEST(FramingCamera, SeesWhatIsFlatFromItsLargerSide) {
  const auto back = [](const glm::dvec3& extent) { return framing_camera({-0.5 * extent, 0.5 * extent}).axes[2]; };
  EXPECT_GT(back({10.0, 0.1, 10.0}).y, 0.6);
  EXPECT_LT(back({10.0, 2.0, 10.0}).y, 0.3);
  EXPECT_LT(back({10.0, 0.1, 0.1}).y, 0.3) << "a beam";
  EXPECT_GT(back({0.1, 10.0, 10.0}).x, 0.9);
  EXPECT_GT(back({10.0, 10.0, 0.1}).z, 0.9);
}

TEST(MakeView, AnOrthographicCameraShowsItsBoxInPicturesOfAnyShape) {
  Camera camera;
  camera.lens = OrthographicLens{2.0, 1.0, 0.1, 10.0};
  for (const Size size : {Size{64, 64}, Size{128, 64}, Size{256, 64}}) {
    const View view = make_view(camera, size, {});
    EXPECT_GE(view.right, 2.0) << size.width;
    EXPECT_GE(view.top, 1.0) << size.width;
    EXPECT_TRUE(view.right == 2.0 || view.top == 1.0) << size.width;
    EXPECT_DOUBLE_EQ(view.right / view.top, static_cast<double>(size.width) / size.height);
  }
}

TEST(MakeView, AnOrthographicCamerasPrecisionIsKeptForTheScene) {
  const Bounds bounds{glm::dvec3(-1.0), glm::dvec3(1.0)};
  Camera camera;
  camera.eye = {0.0, 0.0, 5.0};
  for (const double far : {100.0, 1e5, 1e9, 1e30}) {
    camera.lens = OrthographicLens{2.0, 2.0, 0.1, far};
    const View view = make_view(camera, {8, 8}, bounds);
    EXPECT_LT(view.near_distance, 4.0);
    EXPECT_GT(view.near_distance, 3.9);
    EXPECT_GT(view.far_distance, 6.0);
    EXPECT_LT(view.far_distance, 6.1);
    EXPECT_NE(static_cast<float>(reversed_depth(view, 5.0)), static_cast<float>(reversed_depth(view, 5.0 - 1e-6)));
  }
  // Planes that cut the scene stay where they are, and so do those that leave nothing of it.
  camera.lens = OrthographicLens{2.0, 2.0, 4.5, 5.5};
  EXPECT_EQ(make_view(camera, {8, 8}, bounds).near_distance, 4.5);
  EXPECT_EQ(make_view(camera, {8, 8}, bounds).far_distance, 5.5);
  camera.lens = OrthographicLens{2.0, 2.0, 10.0, 20.0};
  EXPECT_EQ(make_view(camera, {8, 8}, bounds).near_distance, 10.0);
  EXPECT_EQ(make_view(camera, {8, 8}, bounds).far_distance, 20.0);
  EXPECT_EQ(make_view(camera, {8, 8}, {}).near_distance, 10.0);
}

}  // namespace
}  // namespace hpr
