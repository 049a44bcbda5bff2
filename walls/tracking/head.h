#pragma once

#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>

namespace hpr {

/// A head in wall space.
struct HeadPose {
  glm::dvec3 position{0.0};                    ///< metres
  glm::dquat orientation{1.0, 0.0, 0.0, 0.0};  ///< unit; turns the head's right, up, back into wall space

  bool operator==(const HeadPose&) const = default;
};

}  // namespace hpr
