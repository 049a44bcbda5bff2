#include "engine/wall/orbit.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <variant>

namespace hpr {
namespace {

constexpr double kSteepest = 89.0 * std::numbers::pi / 180.0;

/// Metres that the picture is high, as far away as what the camera looks at.
double height_of(const Camera& camera, double distance) {
  if (const auto* const lens = std::get_if<OrthographicLens>(&camera.lens)) return 2.0 * lens->half_height;
  return 2.0 * distance * std::tan(0.5 * std::get<PerspectiveLens>(camera.lens).vertical_fov_radians);
}

}  // namespace

OrbitCamera::OrbitCamera(const Camera& start, const Bounds& bounds) : camera_(start), vertical_(0.0, 1.0, 0.0) {
  constexpr double kLeastUpright = 0.3;
  if (start.axes[1].y < kLeastUpright) vertical_ = start.axes[1];
  const double extent = std::max(glm::length(bounds.high - bounds.low), 1e-6);
  const double ahead = glm::dot(start.axes[2], start.eye - 0.5 * (bounds.low + bounds.high));
  distance_ = std::max(ahead, 0.1 * extent);
  nearest_ = 1e-4 * extent;
  farthest_ = std::max(1e4 * extent, distance_);
}

void OrbitCamera::move(const OrbitInput& input) {
  if (input == OrbitInput{}) return;
  const double height = height_of(camera_, distance_);
  const glm::dvec3 drag = input.pan_right * camera_.axes[0] + input.pan_up * camera_.axes[1];
  const glm::dvec3 target = camera_.eye - distance_ * camera_.axes[2] - height * drag;

  // The scene turns to the right when the camera goes to the left.
  const glm::dvec3 side = glm::normalize(glm::cross(vertical_, camera_.axes[2]));
  const glm::dvec3 level = glm::cross(side, vertical_);
  const double steep = std::asin(std::clamp(glm::dot(camera_.axes[2], vertical_), -1.0, 1.0));
  const double elevation = std::clamp(steep - input.turn_up, std::min(-kSteepest, steep), std::max(kSteepest, steep));
  const glm::dvec3 turned = std::cos(input.turn_right) * level - std::sin(input.turn_right) * side;
  camera_.axes[2] = std::cos(elevation) * turned + std::sin(elevation) * vertical_;
  camera_.axes[0] = glm::normalize(glm::cross(vertical_, camera_.axes[2]));
  camera_.axes[1] = glm::cross(camera_.axes[2], camera_.axes[0]);

  const double nearer = std::exp(-std::clamp(input.dolly, -10.0, 10.0));
  if (auto* const lens = std::get_if<OrthographicLens>(&camera_.lens)) {
    const double low = std::min(nearest_, lens->half_height);
    const double high = std::max(farthest_, lens->half_height);
    const double factor = std::clamp(lens->half_height * nearer, low, high) / lens->half_height;
    lens->half_height *= factor;
    lens->half_width *= factor;
  } else {
    distance_ = std::clamp(distance_ * nearer, nearest_, farthest_);
  }
  camera_.eye = target + distance_ * camera_.axes[2];
}

}  // namespace hpr
