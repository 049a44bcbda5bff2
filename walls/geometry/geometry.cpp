#include "walls/geometry/geometry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>
#include <variant>

#include "walls/geometry/curved.h"

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

/// Wall space as the camera sees it: a rotation about a point that is at the camera's eye.
struct Placement {
  glm::dmat3 world_from_wall{1.0};
  glm::dvec3 anchor{0.0};
  /// The viewer is where the anchor is, with the head turned like this; none: where the wall file or a tracker says.
  std::optional<glm::dquat> facing;
  double height = 0.0;  ///< metres of wall an orthographic camera's height covers
};

Placement place_viewer(const Wall& wall, const WallExtent& extent, const Camera& camera) {
  const WallViewer& first = wall.viewers.front();
  if (first.given || !extent.flat) return {camera.axes, first.position, std::nullopt, extent.height};
  double distance = extent.height;
  if (const auto* const lens = std::get_if<PerspectiveLens>(&camera.lens)) {
    distance = 0.5 * extent.height / std::tan(0.5 * lens->vertical_fov_radians);
  }
  return {camera.axes * glm::transpose(extent.axes), extent.center + extent.axes[2] * distance,
          glm::quat_cast(extent.axes), extent.height};
}

/// `shared` holds what all screens share; `eye` is in wall space.
View screen_view(const View& shared, const WallScreen& screen, const Placement& placement, const glm::dvec3& eye,
                 double clamp) {
  const glm::dmat3 axes = screen_axes(screen);
  const glm::dvec3 from_eye = screen.lower_left - eye;
  View view = shared;
  view.eye += placement.world_from_wall * (eye - placement.anchor);
  view.axes = placement.world_from_wall * axes;

  double scale = 1.0;
  if (view.orthographic) {
    scale = (shared.top - shared.bottom) / placement.height;
  } else {
    const double distance = -glm::dot(from_eye, axes[2]);
    const double held = std::max(distance, clamp);
    // Moving the eye, not only dividing by another number, keeps what lies in the screen's plane where it is. Of points
    // none need lie there.
    if (!screen.warp.points) view.eye += view.axes[2] * (held - distance);
    scale = 1.0 / held;
  }
  view.left = glm::dot(from_eye, axes[0]) * scale;
  view.right = (glm::dot(from_eye, axes[0]) + screen_width(screen)) * scale;
  view.bottom = glm::dot(from_eye, axes[1]) * scale;
  view.top = (glm::dot(from_eye, axes[1]) + screen_height(screen)) * scale;
  if (screen.warp.points) {
    view.points = pixel_points(screen, eye);
    view.points->orthographic = view.orthographic;
    view.points->scale = view.orthographic ? scale : 1.0;
  }
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

std::vector<HeadPose> resting_heads(const Wall& wall) {
  std::vector<HeadPose> heads;
  for (const WallViewer& viewer : wall.viewers) heads.push_back({viewer.position});
  return heads;
}

glm::dvec3 eye_position(const WallViewer& viewer, const HeadPose& head, Eye eye) {
  const double side = eye == Eye::Left ? -0.5 : eye == Eye::Right ? 0.5 : 0.0;
  const glm::dvec3 inside = viewer.eye_offset + glm::dvec3(side * viewer.ipd_m, 0.0, 0.0);
  // A head that looks straight ahead loses no digit to the quaternion.
  return head.position + (head.orientation == glm::dquat(1.0, 0.0, 0.0, 0.0) ? inside : head.orientation * inside);
}

std::vector<View> wall_views(const Wall& wall, std::span<const HeadPose> heads, const Camera& camera,
                             const Bounds& bounds) {
  HPR_CHECK(heads.size() == wall.viewers.size());
  const WallExtent extent = wall_extent(wall);
  const Placement placement = place_viewer(wall, extent, camera);
  View shared = make_view(camera, {1, 1}, bounds);
  if (const auto* const box = std::get_if<OrthographicLens>(&camera.lens)) {  // in the shape of the wall, all of it
    shared.top = std::max(box->half_height, box->half_width * extent.height / extent.width);
    shared.bottom = -shared.top;
    shared.near_distance = box->near_distance;  // each screen has its own way to the scene
    shared.far_distance = box->far_distance;
  }
  std::vector<View> views;
  for (const ScreenEye& picture : screen_eyes(wall)) {
    const WallScreen& screen = wall.screens[picture.screen];
    const WallViewer& viewer = wall.viewers.at(screen.viewer);
    HeadPose head = heads[screen.viewer];
    if (placement.facing) head = {placement.anchor, *placement.facing};
    const glm::dvec3 eye = shared.orthographic ? placement.anchor : eye_position(viewer, head, picture.eye);
    View view = screen_view(shared, screen, placement, eye, viewer.clamp_distance_m);
    if (viewer.near_m > 0.0 && !shared.orthographic) view.near_distance = viewer.near_m;
    tighten(view, bounds);
    view.screen = picture.pixels;
    view.block = {0, 0, picture.pixels.width, picture.pixels.height};
    view.screen_number = static_cast<std::uint32_t>(views.size());
    views.push_back(view);
  }
  return views;
}

std::vector<View> wall_views(const Wall& wall, const Camera& camera, const Bounds& bounds) {
  return wall_views(wall, resting_heads(wall), camera, bounds);
}

}  // namespace hpr
