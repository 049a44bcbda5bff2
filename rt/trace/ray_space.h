#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/vec3.hpp>

#include "scene/scene.h"

namespace hpr {

/// The float coordinates rays are traced in: world metres relative to the scene's centre, scaled by a power of two so
/// that the scene's radius lies in [1, 2). Both steps are done in double; the scale is exact, so a scene scaled by a
/// power of two gives the same bits.
struct RaySpace {
  glm::dvec3 origin{0.0};
  double scale = 1.0;
  double radius = 1.0;  ///< the scene's, in ray space: [1, 2)

  RaySpace() = default;
  explicit RaySpace(const Bounds& bounds) {
    const glm::dvec3 half = 0.5 * bounds.high - 0.5 * bounds.low;
    const double extent = std::max({half.x, half.y, half.z});
    if (!std::isfinite(extent)) return;
    origin = 0.5 * bounds.high + 0.5 * bounds.low;
    if (!(extent > 0.0)) return;
    scale = std::ldexp(1.0, std::clamp(-std::ilogb(extent), -1000, 1000));
    radius = extent * scale;
  }

  [[nodiscard]] glm::dvec3 from_world(const glm::dvec3& world) const { return (world - origin) * scale; }
};

/// One unit in the last place of a float near 1: what a coordinate may lose on its way into Embree.
inline constexpr double kFloatStep = 1.1920928955078125e-7;

/// How many such steps a ray's origin is moved off its surface. Measured over object radii of 1e-9 to 1e9 and offsets
/// of the centre up to 1e4 radii: no surface hits itself (Embree's triangle test needs about three).
inline constexpr double kOriginSteps = 4.0;

}  // namespace hpr
