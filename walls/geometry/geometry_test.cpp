#include "walls/geometry/geometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <random>

#include "walls/config/example_walls.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

constexpr Bounds kBounds{{-1.0, -1.0, -1.0}, {1.0, 1.0, 1.0}};

Camera perspective(double fov) {
  Camera camera = look_at({3.0, 2.0, 5.0}, {0.0, 0.5, 0.0}, {0.0, 1.0, 0.0}, fov);
  camera.lens = PerspectiveLens{fov, 0.1};
  return camera;
}

/// Eye at the origin, looking down -z.
Camera straight() {
  Camera camera;
  camera.lens = PerspectiveLens{1.0, 0.1};
  return camera;
}

Wall wall_of(const std::vector<WallScreen>& screens, const glm::dvec3& viewer) {
  Wall wall;
  wall.screens = screens;
  wall.viewers.front().position = viewer;
  wall.viewers.front().has_position = true;
  return wall;
}

WallScreen screen_at(const glm::dvec3& ll, const glm::dvec3& lr, const glm::dvec3& ul, Size pixels) {
  WallScreen screen;
  screen.id = "s";
  screen.pixels = pixels;
  screen.lower_left = ll;
  screen.lower_right = lr;
  screen.upper_left = ul;
  return screen;
}

/// Where a ray meets the screen's plane, wall space (the camera is straight(), the eye is the viewer).
glm::dvec3 on_screen(const View& view, const WallScreen& screen, const glm::dvec3& viewer, double x, double y) {
  const Ray ray = view_ray(view, x, y);
  const glm::dvec3 origin = viewer + ray.origin;
  const glm::dvec3 normal = screen_axes(screen)[2];
  const double t = glm::dot(screen.lower_left - origin, normal) / glm::dot(ray.direction, normal);
  return origin + ray.direction * t;
}

TEST(WallGeometry, ACenteredScreenIsASymmetricFrustum) {
  const double fov = 0.7;
  const double height = 2.0 * std::tan(0.5 * fov);
  const double width = height * 1.6;
  const WallScreen screen = screen_at({-0.5 * width, -0.5 * height, -1.0}, {0.5 * width, -0.5 * height, -1.0},
                                      {-0.5 * width, 0.5 * height, -1.0}, {160, 100});
  const Camera camera = perspective(fov);
  const View view = wall_views(wall_of({screen}, glm::dvec3(0.0)), camera, kBounds).at(0);
  const View plain = make_view(camera, {160, 100}, kBounds);
  EXPECT_EQ(view.eye, plain.eye);
  for (int i = 0; i < 3; ++i) EXPECT_LT(glm::distance(view.axes[i], plain.axes[i]), 1e-15);
  EXPECT_NEAR(view.left, plain.left, 1e-15);
  EXPECT_NEAR(view.right, plain.right, 1e-15);
  EXPECT_NEAR(view.bottom, plain.bottom, 1e-15);
  EXPECT_NEAR(view.top, plain.top, 1e-15);
  EXPECT_EQ(view.near_distance, plain.near_distance);
  EXPECT_EQ(view.screen, plain.screen);
  EXPECT_EQ(view.block, plain.block);
}

TEST(WallGeometry, RaysThroughPixelCornersHitTheScreensCorners) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> number(-2.0, 2.0);
  for (int i = 0; i < 200; ++i) {
    const glm::dvec3 right = glm::normalize(glm::dvec3(number(random), number(random), number(random)));
    const glm::dvec3 other(number(random), number(random), number(random));
    const glm::dvec3 up = glm::normalize(glm::cross(other, right));
    const glm::dvec3 ll(number(random), number(random), number(random));
    const WallScreen screen = screen_at(ll, ll + right * 1.5, ll + up * 0.8, {1920, 1080});
    // Somewhere before the screen, anywhere sideways.
    const glm::dvec3 viewer =
        ll + right * number(random) + up * number(random) + screen_axes(screen)[2] * (0.2 + std::abs(number(random)));
    const View view = wall_views(wall_of({screen}, viewer), straight(), kBounds).at(0);
    EXPECT_LT(glm::distance(on_screen(view, screen, viewer, 0.0, 1080.0), screen.lower_left), 1e-12);
    EXPECT_LT(glm::distance(on_screen(view, screen, viewer, 1920.0, 1080.0), screen.lower_right), 1e-12);
    EXPECT_LT(glm::distance(on_screen(view, screen, viewer, 0.0, 0.0), screen.upper_left), 1e-12);
  }
}

TEST(WallGeometry, TheCavesScreensMeetAtTheirEdges) {
  const Wall wall = load_wall(test::example_wall("cave-4.toml"));
  const std::vector<View> views = wall_views(wall, straight(), kBounds);
  ASSERT_EQ(views.size(), 4U);
  const View& left = views[0];
  const View& front = views[1];
  const View& floor = views[3];
  EXPECT_LT(glm::distance(left.axes[2], glm::dvec3(1.0, 0.0, 0.0)), 1e-15);
  EXPECT_LT(glm::distance(floor.axes[2], glm::dvec3(0.0, 1.0, 0.0)), 1e-15);
  EXPECT_EQ(front.near_distance, 0.05);
  // 1.7 m of eye over 1.5 m of distance.
  EXPECT_NEAR(front.bottom, -1.7 / 1.5, 1e-15);
  EXPECT_NEAR(front.top, 0.7 / 1.5, 1e-15);
  EXPECT_NEAR(front.left, -1.0, 1e-15);
  // The left screen's right edge is the front's left edge, the front's lower edge the floor's upper one: same rays.
  for (const double t : {0.0, 0.25, 1.0}) {
    const glm::dvec3 a = glm::normalize(view_ray(left, 2400.0, 1920.0 * t).direction);
    const glm::dvec3 b = glm::normalize(view_ray(front, 0.0, 1920.0 * t).direction);
    EXPECT_LT(glm::distance(a, b), 1e-14);
    const glm::dvec3 c = glm::normalize(view_ray(front, 2400.0 * t, 1920.0).direction);
    const glm::dvec3 d = glm::normalize(view_ray(floor, 2400.0 * t, 0.0).direction);
    EXPECT_LT(glm::distance(c, d), 1e-14);
  }
}

/// Pixel coordinates of a world point on a view, from its upper left corner.
glm::dvec2 project(const View& view, const glm::dvec3& world) {
  const glm::dvec3 p = glm::transpose(view.axes) * (world - view.eye);
  const double x = view.orthographic ? p.x : p.x / -p.z;
  const double y = view.orthographic ? p.y : p.y / -p.z;
  return {(x - view.left) / (view.right - view.left) * view.screen.width,
          (view.top - y) / (view.top - view.bottom) * view.screen.height};
}

TEST(WallGeometry, ALineStaysStraightAcrossGapsOfFractionalPixels) {
  for (const char* const name : {"desktop-3x2.toml", "wall-6x3-4k.toml"}) {
    const Wall wall = load_wall(test::example_wall(name));
    const Camera camera = perspective(0.8);
    const std::vector<View> views = wall_views(wall, camera, kBounds);
    const WallExtent extent = wall_extent(wall);
    // Oblique through the scene, far to near.
    const glm::dvec3 start = camera.eye + camera.axes * glm::dvec3(-2.5, -1.0, -4.0);
    const glm::dvec3 end = camera.eye + camera.axes * glm::dvec3(4.0, 2.0, -7.0);
    std::vector<glm::dvec2> points;  // in the wall's plane, in pixels of the wall
    for (int step = 0; step <= 2000; ++step) {
      const glm::dvec3 world = start + (end - start) * (step / 2000.0);
      for (std::size_t i = 0; i < views.size(); ++i) {
        const glm::dvec2 pixel = project(views[i], world);
        const WallScreen& screen = wall.screens[i];
        if (pixel.x < 0 || pixel.y < 0 || pixel.x > screen.pixels.width || pixel.y > screen.pixels.height) continue;
        const double pitch = pixel_pitch(screen);
        const glm::dvec3 on_wall = glm::transpose(extent.axes) * (screen.upper_left - extent.center);
        points.emplace_back(on_wall.x / pitch + pixel.x, on_wall.y / pitch - pixel.y);
      }
    }
    ASSERT_GT(points.size(), 200U) << name;
    const glm::dvec2 along = glm::normalize(points.back() - points.front());
    double worst = 0.0;
    for (const glm::dvec2& p : points) {
      const glm::dvec2 d = p - points.front();
      worst = std::max(worst, std::abs(d.x * along.y - d.y * along.x));
    }
    EXPECT_LT(worst, 0.01) << name;
    EXPECT_LT(worst, 1e-6) << name;
    EXPECT_GT(glm::distance(points.front(), points.back()), 0.5 * extent.width / finest_pitch(wall));
  }
}

TEST(WallGeometry, AWallWithoutViewerShowsWhatTheCameraSees) {
  const Wall wall = load_wall("3x2");
  const WallExtent extent = wall_extent(wall);
  const Camera camera = perspective(0.9);
  const std::vector<View> views = wall_views(wall, camera, kBounds);
  const double half = std::tan(0.45);
  const double aspect = extent.width / extent.height;
  EXPECT_NEAR(views[0].top, half, 1e-14);
  EXPECT_NEAR(views[0].left, -half * aspect, 1e-14);
  EXPECT_NEAR(views[5].bottom, -half, 1e-14);
  EXPECT_NEAR(views[5].right, half * aspect, 1e-14);
  for (const View& view : views) {
    EXPECT_LT(glm::distance(view.eye, camera.eye), 1e-14);
    EXPECT_LT(glm::distance(view.axes[2], camera.axes[2]), 1e-14);
  }
}

TEST(WallGeometry, AWallThatFacesElsewhereIsTurnedTowardsTheCamera) {
  // Faces +x, 40 m away.
  Wall wall = wall_of({screen_at({40.0, 1.0, 3.0}, {40.0, 1.0, 1.0}, {40.0, 2.0, 3.0}, {200, 100})}, glm::dvec3(0.0));
  wall.viewers.front().has_position = false;
  const Camera camera = perspective(0.9);
  const View view = wall_views(wall, camera, kBounds).at(0);
  const View plain = make_view(camera, {200, 100}, kBounds);
  EXPECT_LT(glm::distance(view.eye, plain.eye), 1e-12);
  for (int i = 0; i < 3; ++i) EXPECT_LT(glm::distance(view.axes[i], plain.axes[i]), 1e-14);
  EXPECT_NEAR(view.left, plain.left, 1e-13);
  EXPECT_NEAR(view.top, plain.top, 1e-13);
}

TEST(WallGeometry, AnOrthographicCameraCoversItsHalfHeightWithHalfTheWall) {
  const Wall wall = load_wall("2x1");
  Camera camera = perspective(0.9);
  camera.lens = OrthographicLens{4.0, 3.0, 0.5, 50.0};
  const std::vector<View> views = wall_views(wall, camera, kBounds);
  const WallExtent extent = wall_extent(wall);
  const double per_meter = 6.0 / extent.height;
  EXPECT_TRUE(views[0].orthographic);
  EXPECT_NEAR(views[0].top, 3.0, 1e-14);
  EXPECT_NEAR(views[0].bottom, -3.0, 1e-14);
  EXPECT_NEAR(views[0].left, -0.5 * extent.width * per_meter, 1e-13);
  EXPECT_NEAR(views[1].left - views[0].right, 0.006 * per_meter, 1e-13);
  EXPECT_GE(views[0].near_distance, 0.5);
  EXPECT_LE(views[0].far_distance, 50.0);
  camera.lens = OrthographicLens{30.0, 3.0, 0.5, 50.0};
  const std::vector<View> wide = wall_views(wall, camera, kBounds);
  EXPECT_NEAR(wide[1].right - wide[0].left, 60.0, 1e-12);
}

TEST(WallGeometry, AnOrthographicCameraSeesTheWholeSceneOnTurnedScreensToo) {
  Wall wall = wall_of({screen_at({-1, -1, -2}, {1, -1, -2}, {-1, 1, -2}, {64, 64}),
                       screen_at({1, -1, -2}, {1, -1, 0}, {1, 1, -2}, {64, 64})},
                      {0.0, 0.0, 0.0});
  const Bounds wide{{-9.0, -1.0, -0.5}, {9.0, 1.0, 0.5}};
  Camera camera = straight();
  camera.lens = OrthographicLens{4.0, 3.0, 0.01, 100.0};
  const std::vector<View> views = wall_views(wall, camera, wide);
  ASSERT_EQ(views.size(), 2U);
  EXPECT_LT(std::abs(glm::dot(views[0].axes[2], views[1].axes[2])), 1e-12) << "a right angle";
  for (const View& view : views) {
    EXPECT_LT(view.far_distance - view.near_distance, 50.0) << "no more than needed";
    for (int corner = 0; corner < 8; ++corner) {
      const glm::dvec3 at((corner & 1) != 0 ? wide.high.x : wide.low.x, (corner & 2) != 0 ? wide.high.y : wide.low.y,
                          (corner & 4) != 0 ? wide.high.z : wide.low.z);
      const double depth = glm::dot(view.eye - at, view.axes[2]);
      if (depth < 0.01) continue;  // behind the camera's own plane
      EXPECT_LE(view.near_distance, depth) << view.screen_number << ", corner " << corner;
      EXPECT_GE(view.far_distance, depth) << view.screen_number << ", corner " << corner;
    }
  }
}

TEST(WallGeometry, AnEyeInTheScreensPlaneIsHeldAtTheClampDistance) {
  const WallScreen screen = screen_at({-1.0, -1.0, -2.0}, {1.0, -1.0, -2.0}, {-1.0, 1.0, -2.0}, {100, 100});
  for (const double distance : {1e-3, 1e-9, 0.0, -1.0}) {
    const glm::dvec3 viewer(0.3, 0.2, -2.0 + distance);
    Wall wall = wall_of({screen}, viewer);
    wall.viewers.front().clamp_distance_m = 0.1;
    const View view = wall_views(wall, straight(), kBounds).at(0);
    for (const double edge : {view.left, view.right, view.bottom, view.top}) ASSERT_TRUE(std::isfinite(edge));
    EXPECT_NEAR(view.right - view.left, 2.0 / 0.1, 1e-12);
    EXPECT_NEAR(view.eye.z, 0.1 - distance, 1e-12);
    EXPECT_LT(glm::distance(on_screen(view, screen, viewer, 0.0, 100.0), screen.lower_left), 1e-12);
  }
}

TEST(WallGeometry, NearPlaneIsTheWallsElseTheCameras) {
  Wall wall = load_wall("1x1");
  EXPECT_EQ(wall_views(wall, perspective(0.5), kBounds).at(0).near_distance, 0.1);
  wall.viewers.front().near_m = 0.25;
  EXPECT_EQ(wall_views(wall, perspective(0.5), kBounds).at(0).near_distance, 0.25);
}

TEST(WallPictureTest, AFlatWallStandsAtItsPixelsWithRoundedGaps) {
  const Wall wall = load_wall(test::example_wall("desktop-3x2.toml"));
  const WallPicture picture = wall_picture(wall, 16384);
  EXPECT_EQ(picture.size, (Size{1945, 733}));
  EXPECT_EQ(picture.screens[0], (Rect{0, 0, 640, 360}));
  EXPECT_EQ(picture.screens[1], (Rect{653, 0, 1293, 360}));
  EXPECT_EQ(picture.screens[2], (Rect{1305, 0, 1945, 360}));
  EXPECT_EQ(picture.screens[5], (Rect{1305, 373, 1945, 733}));
}

TEST(WallPictureTest, ALargeWallIsScaledDownAndNeverOverlaps) {
  for (const char* const name : {"wall-6x3-4k.toml", "cave-4.toml", "desktop-3x2.toml"}) {
    const Wall wall = load_wall(test::example_wall(name));
    for (const int side : {1, 10, 777, 4096, 100000}) {
      const WallPicture picture = wall_picture(wall, side);
      if (side >= 10) {
        EXPECT_LE(picture.size.width, side + 1) << name;
        EXPECT_LE(picture.size.height, side + 1) << name;
      }
      for (std::size_t i = 0; i < picture.screens.size(); ++i) {
        EXPECT_FALSE(picture.screens[i].empty());
        EXPECT_EQ(intersection(picture.screens[i], {0, 0, picture.size.width, picture.size.height}),
                  picture.screens[i]);
        for (std::size_t j = 0; j < i && side >= 777; ++j) {
          EXPECT_TRUE(intersection(picture.screens[i], picture.screens[j]).empty()) << name << side;
        }
      }
    }
  }
}

TEST(WallPictureTest, ACaveIsUnfoldedLeftFrontRightWithTheFloorBelow) {
  const WallPicture picture = wall_picture(load_wall(test::example_wall("cave-4.toml")), 2000);
  const Rect left = picture.screens[0];
  const Rect front = picture.screens[1];
  const Rect right = picture.screens[2];
  const Rect floor = picture.screens[3];
  EXPECT_LT(left.x1, front.x0);
  EXPECT_LT(front.x1, right.x0);
  EXPECT_EQ(left.y0, front.y0);
  EXPECT_LT(front.y1, floor.y0);
  EXPECT_NEAR(floor.x0, front.x0, 1);
}

TEST(WallSeamsTest, CountsWhatWholePixelsWouldLose) {
  const WallSeams desktop = wall_seams(load_wall(test::example_wall("desktop-3x2.toml")));
  EXPECT_EQ(desktop.count, 2 * 2 + 3);
  EXPECT_NEAR(desktop.narrowest_m, 0.010, 1e-12);
  EXPECT_NEAR(desktop.widest_m, 0.010, 1e-12);
  EXPECT_NEAR(desktop.largest_error_px, 0.5, 1e-9);
  const WallSeams large = wall_seams(load_wall(test::example_wall("wall-6x3-4k.toml")));
  EXPECT_EQ(large.count, 3 * 5 + 6 * 2);
  EXPECT_NEAR(large.largest_error_px, 0.2857, 1e-4);
  EXPECT_NEAR(large.accumulated_error_px, 1.4286, 1e-4);
  EXPECT_NEAR(wall_seams(load_wall("3x2")).largest_error_px, 0.0, 1e-9);
  EXPECT_EQ(wall_seams(load_wall(test::example_wall("cave-4.toml"))).count, 0);
  // Passive stereo has each screen twice, in one place.
  Wall passive = load_wall("3x2");
  const int seams = wall_seams(passive).count;
  for (WallScreen& screen : passive.screens) screen.eye = Eye::Left;
  const std::vector<WallScreen> left = passive.screens;
  for (WallScreen screen : left) {
    screen.eye = Eye::Right;
    passive.screens.push_back(screen);
  }
  EXPECT_EQ(wall_seams(passive).count, seams);
  EXPECT_GE(wall_seams(passive).narrowest_m, 0.0);
}

TEST(WallPlanes, GroupScreensByPlaneFromLeftToRight) {
  EXPECT_EQ(wall_planes(load_wall("3x2")), (std::vector<std::vector<std::size_t>>{{0, 1, 2, 3, 4, 5}}));
  const auto cave = wall_planes(load_wall(test::example_wall("cave-4.toml")));
  ASSERT_EQ(cave.size(), 4U);
  EXPECT_EQ(std::ranges::count(cave, std::vector<std::size_t>{3}), 1);
}

}  // namespace
}  // namespace hpr
