#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "walls/config/wall_file.h"
#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

constexpr const char* kGrid =
    "hpr_wall = 1\n[[surfaces]]\n[surfaces.grid]\ncolumns = 5\nrows = 2\ntile_pixels = [192, 108]\ntile_size_m = "
    "[0.96, 0.54]\ncentre_m = [0.5, 1.5, -2.0]\ncolumn_gaps_m = [0.01, 0.03, 0.02, 0.01]\ngap_m = [0.0, 0.02]\n";

Wall curved(const std::string& curve) {
  const WallReading reading = parse_wall(kGrid + curve + "\n", "t.toml");
  for (const WallFinding& finding : reading.findings) ADD_FAILURE() << finding.what;
  return reading.wall;
}

std::string error_of(const std::string& curve) {
  for (const WallFinding& finding : parse_wall(kGrid + curve + "\n", "t.toml").findings) {
    if (finding.error) return finding.what;
  }
  return "";
}

TEST(CurvedGrid, CornersLieOnTheArcAndColumnsAreChords) {
  const double radius = 3.0;
  const Wall wall = curved("curve = { radius_m = 3.0 }");
  ASSERT_EQ(wall.screens.size(), 10U);
  const glm::dvec3 axis(0.5, 0.0, -2.0 + radius);
  for (const WallScreen& screen : wall.screens) {
    for (const glm::dvec3& corner : {screen.lower_left, screen.lower_right, screen.upper_left}) {
      EXPECT_NEAR(std::hypot(corner.x - axis.x, corner.z - axis.z), radius, 1e-12);
    }
    EXPECT_NEAR(screen_width(screen), 0.96, 1e-12);
    EXPECT_NEAR(screen_height(screen), 0.54, 1e-12);
    EXPECT_GT(glm::dot(screen_axes(screen)[2], axis - screen_center(screen)), 0.0) << "faces inwards";
  }
}

TEST(CurvedGrid, GapsAreMeasuredAlongTheArcAndTheMiddleFacesTheCentre) {
  const double radius = 3.0;
  const Wall wall = curved("curve = { radius_m = 3.0 }");
  const auto angle = [&](const glm::dvec3& p) { return std::atan2(p.x - 0.5, -2.0 + radius - p.z); };
  const double gaps[] = {0.01, 0.03, 0.02, 0.01};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(radius * (angle(wall.screens[i + 1].lower_left) - angle(wall.screens[i].lower_right)), gaps[i], 1e-12);
  }
  EXPECT_NEAR(angle(wall.screens[0].lower_left), -angle(wall.screens[4].lower_right), 1e-12);
  // Rows as in a plane.
  EXPECT_NEAR(wall.screens[0].lower_left.y - wall.screens[5].upper_left.y, 0.02, 1e-12);
  EXPECT_NEAR(wall.screens[0].upper_left.y, 1.5 + 0.55, 1e-12);
}

TEST(CurvedGrid, AnAngleIsThatBetweenTheOuterEdges) {
  for (const double degrees : {1e-4, 10.0, 90.0, 270.0}) {
    const Wall wall = curved("curve = { angle_degrees = " + std::to_string(degrees) + " }");
    const WallScreen& first = wall.screens[0];
    const WallScreen& last = wall.screens[4];
    // The tangents there: half a column's angle beyond the chords.
    const double chords = std::acos(glm::clamp(glm::dot(screen_axes(first)[2], screen_axes(last)[2]), -1.0, 1.0));
    const double between = degrees > 180.0 ? 2.0 * std::numbers::pi - chords : chords;
    const double radius = glm::length(first.lower_left - glm::dvec3(0.5, first.lower_left.y, -2.0)) /
                          (2.0 * std::sin(degrees * std::numbers::pi / 720.0));
    const double column = 2.0 * std::asin(0.48 / radius);
    EXPECT_NEAR(between + column, degrees * std::numbers::pi / 180.0, 1e-6) << degrees;
  }
}

TEST(CurvedGrid, AHardlyCurvedWallIsTheFlatOne) {
  const Wall flat = curved("");
  const Wall wall = curved("curve = { radius_m = 900000.0 }");
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    EXPECT_LT(glm::distance(wall.screens[i].lower_left, flat.screens[i].lower_left), 1e-5);
  }
}

TEST(CurvedGrid, FrustaGoThroughItsCorners) {
  Wall wall = curved("curve = { angle_degrees = 120 }");
  wall.viewers.front().position = {0.4, 1.6, -0.3};
  wall.viewers.front().has_position = true;
  Camera camera;
  camera.lens = PerspectiveLens{1.0, 0.1};
  const std::vector<View> views = wall_views(wall, camera, {});
  for (std::size_t i = 0; i < views.size(); ++i) {
    const WallScreen& screen = wall.screens[i];
    const glm::dvec3 eye = wall.viewers.front().position;
    const auto corner = [&](double x, double y) {
      const Ray ray = view_ray(views[i], x, y);
      const glm::dvec3 normal = screen_axes(screen)[2];
      return eye + ray.direction * (glm::dot(screen.lower_left - eye, normal) / glm::dot(ray.direction, normal));
    };
    EXPECT_LT(glm::distance(corner(0.0, 108.0), screen.lower_left), 1e-9);
    EXPECT_LT(glm::distance(corner(192.0, 108.0), screen.lower_right), 1e-9);
    EXPECT_LT(glm::distance(corner(0.0, 0.0), screen.upper_left), 1e-9);
  }
}

TEST(CurvedGrid, WhatFitsNoCircleIsAnError) {
  EXPECT_EQ(error_of("curve = { radius_m = 0.5 }"),
            "t.toml:11:22: 'radius_m' of curve is 0.5, and the columns go more than once around");
  EXPECT_EQ(error_of("curve = { radius_m = 1.0, angle_degrees = 90 }"),
            "t.toml:11:9: curve has either radius_m or angle_degrees");
  EXPECT_EQ(error_of("curve = { }"), "t.toml:11:9: curve has either radius_m or angle_degrees");
  EXPECT_EQ(error_of("curve = { radius = 1.0 }"), "t.toml:11:9: curve has either radius_m or angle_degrees");
  EXPECT_EQ(error_of("curve = { angle_degrees = 400 }"), "t.toml:11:27: 'angle_degrees' of curve is 400");
}

}  // namespace
}  // namespace hpr
