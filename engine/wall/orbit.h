#pragma once

#include "scene/scene.h"
#include "walls/displays/display.h"

namespace hpr {

/// A camera that viewers turn about what it looks at. Turns go about the world's vertical (+y), or the camera's own
/// where it lies on its side, and stop short of looking straight up or down.
class OrbitCamera {
 public:
  /// It looks at the middle of `bounds`, or at what lies as far away straight ahead.
  OrbitCamera(const Camera& start, const Bounds& bounds);

  /// Stays at distances, and an orthographic camera at picture sizes, from which there is a way back.
  void move(const OrbitInput& input);
  /// The start's own bits until moved.
  [[nodiscard]] const Camera& camera() const { return camera_; }

 private:
  Camera camera_;
  glm::dvec3 vertical_;
  double distance_;  ///< to what it looks at
  double nearest_;
  double farthest_;
};

}  // namespace hpr
