#include "walls/geometry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <variant>

namespace hpr {
namespace {

/// The up direction of a plane with normal `n`: y as far as it lies in the plane, else the fallback's.
glm::dvec3 up_in_plane(const glm::dvec3& n, const glm::dvec3& fallback) {
  constexpr double kNearlyParallel = 0.9;
  const glm::dvec3 up = std::abs(n.y) < kNearlyParallel ? glm::dvec3(0.0, 1.0, 0.0) : fallback;
  const glm::dvec3 inside = up - n * glm::dot(up, n);
  return glm::normalize(inside);
}

std::array<glm::dvec3, 4> corners_of(const WallScreen& screen) {
  return {screen.lower_left, screen.lower_right, screen.upper_left,
          screen.lower_right + (screen.upper_left - screen.lower_left)};
}

/// Wall space as the camera sees it: a rotation, and the viewer who stands at the camera's eye.
struct Placement {
  glm::dmat3 world_from_wall{1.0};
  glm::dvec3 viewer{0.0};
  double height = 0.0;  ///< metres of wall an orthographic camera's height covers
};

Placement place_viewer(const Wall& wall, const WallExtent& extent, const Camera& camera) {
  if (wall.viewer_given || !extent.flat) return {camera.axes, wall.viewer, extent.height};
  double distance = extent.height;
  if (const auto* const lens = std::get_if<PerspectiveLens>(&camera.lens)) {
    distance = 0.5 * extent.height / std::tan(0.5 * lens->vertical_fov_radians);
  }
  return {camera.axes * glm::transpose(extent.axes), extent.center + extent.axes[2] * distance, extent.height};
}

/// `template_view` holds what all screens share.
View screen_view(const View& template_view, const WallScreen& screen, const Placement& placement, double clamp) {
  const glm::dmat3 axes = screen_axes(screen);
  const glm::dvec3 from_viewer = screen.lower_left - placement.viewer;
  View view = template_view;
  view.axes = placement.world_from_wall * axes;
  view.screen = screen.pixels;
  view.block = {0, 0, screen.pixels.width, screen.pixels.height};

  double scale = 1.0;
  if (view.orthographic) {
    scale = (template_view.top - template_view.bottom) / placement.height;
  } else {
    const double distance = -glm::dot(from_viewer, axes[2]);
    const double held = std::max(distance, clamp);
    // Moving the eye, not only dividing by another number, keeps what lies in the screen's plane where it is.
    view.eye += view.axes[2] * (held - distance);
    scale = 1.0 / held;
  }
  view.left = glm::dot(from_viewer, axes[0]) * scale;
  view.right = (glm::dot(from_viewer, axes[0]) + screen_width(screen)) * scale;
  view.bottom = glm::dot(from_viewer, axes[1]) * scale;
  view.top = (glm::dot(from_viewer, axes[1]) + screen_height(screen)) * scale;
  return view;
}

}  // namespace

glm::dmat3 screen_axes(const WallScreen& screen) {
  const glm::dvec3 right = glm::normalize(screen.lower_right - screen.lower_left);
  const glm::dvec3 back = glm::normalize(glm::cross(right, screen.upper_left - screen.lower_left));
  return {right, glm::cross(back, right), back};
}

glm::dvec3 screen_center(const WallScreen& screen) {
  return 0.5 * (screen.lower_right + screen.upper_left);
}

double pixel_pitch(const WallScreen& screen) {
  return screen_width(screen) / screen.pixels.width;
}

double finest_pitch(const Wall& wall) {
  double finest = std::numeric_limits<double>::infinity();
  for (const WallScreen& screen : wall.screens) finest = std::min(finest, pixel_pitch(screen));
  return finest;
}

WallExtent wall_extent(std::span<const WallScreen> screens) {
  HPR_CHECK(!screens.empty());
  constexpr double kFlatness = 1e-6;
  WallExtent extent;
  glm::dvec3 normal(0.0);
  for (const WallScreen& screen : screens) {
    normal += screen_axes(screen)[2];
    extent.middle += screen_center(screen) / static_cast<double>(screens.size());
  }
  // Screens all round the viewer cancel out; then the first one says where the front is.
  const glm::dmat3 first = screen_axes(screens.front());
  const bool has_front = glm::length(normal) > 0.1 * static_cast<double>(screens.size());
  extent.axes[2] = has_front ? glm::normalize(normal) : first[2];
  const bool first_up_usable = std::abs(glm::dot(first[1], extent.axes[2])) < 0.9;
  extent.axes[1] = up_in_plane(extent.axes[2], first_up_usable ? first[1] : first[0]);
  extent.axes[0] = glm::cross(extent.axes[1], extent.axes[2]);

  glm::dvec3 low(std::numeric_limits<double>::infinity());
  glm::dvec3 high = -low;
  const glm::dmat3 extent_from_wall = glm::transpose(extent.axes);
  for (const WallScreen& screen : screens) {
    for (const glm::dvec3& corner : corners_of(screen)) {
      // Relative to the middle, so that a wall far from the origin loses no digits.
      const glm::dvec3 inside = extent_from_wall * (corner - extent.middle);
      low = glm::min(low, inside);
      high = glm::max(high, inside);
    }
    if (glm::dot(screen_axes(screen)[2], extent.axes[2]) < 1.0 - kFlatness) extent.flat = false;
  }
  extent.width = high.x - low.x;
  extent.height = high.y - low.y;
  if (high.z - low.z > kFlatness * (extent.width + extent.height)) extent.flat = false;
  extent.center = extent.middle + extent.axes * (0.5 * (low + high));
  return extent;
}

std::vector<View> wall_views(const Wall& wall, const Camera& camera, const Bounds& bounds) {
  const Placement placement = place_viewer(wall, wall_extent(wall), camera);
  View shared = make_view(camera, {1, 1}, bounds);
  if (wall.near_m > 0.0 && !shared.orthographic) shared.near_distance = wall.near_m;
  std::vector<View> views;
  views.reserve(wall.screens.size());
  for (const WallScreen& screen : wall.screens) {
    views.push_back(screen_view(shared, screen, placement, wall.clamp_distance_m));
    views.back().screen_number = static_cast<std::uint32_t>(views.size() - 1);
  }
  return views;
}

}  // namespace hpr
