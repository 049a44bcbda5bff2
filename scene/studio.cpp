#include "scene/studio.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

namespace hpr {
namespace {

/// A round lamp far away, whose edge fades.
struct Lamp {
  glm::dvec3 direction;  ///< of its middle, any length
  double radius_degrees;
  double radiance;
};

constexpr std::array<Lamp, 4> kLamps{{
    {{-0.6, 0.75, 0.65}, 22.0, 3.2},
    {{0.9, 0.5, 0.45}, 22.0, 1.4},
    {{0.0, 1.0, 0.0}, 24.0, 1.0},
    {{0.35, 0.6, -0.9}, 16.0, 2.4},
}};

constexpr double kFloor = 0.2;
constexpr double kHorizon = 0.35;
constexpr double kCeiling = 0.7;

double smooth_step(double x) {
  const double t = std::clamp(x, 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

double radiance_towards(const glm::dvec3& direction) {
  const double up = direction.y;
  double radiance = up < 0.0 ? std::lerp(kHorizon, kFloor, smooth_step(-up)) : std::lerp(kHorizon, kCeiling, up * up);
  for (const Lamp& lamp : kLamps) {
    const double cosine = std::clamp(glm::dot(direction, glm::normalize(lamp.direction)), -1.0, 1.0);
    const double degrees = std::acos(cosine) * 180.0 / std::numbers::pi;
    constexpr double kEdge = 6.0;  // degrees, in which it fades
    const double inside = smooth_step((lamp.radius_degrees - degrees) / kEdge + 0.5);
    radiance = std::lerp(radiance, lamp.radiance, inside);
  }
  return radiance;
}

}  // namespace

Environment make_studio() {
  constexpr Size kSize{256, 128};
  Environment studio{Image<Rgb>(kSize)};
  for (int y = 0; y < kSize.height; ++y) {
    const double polar = std::numbers::pi * (y + 0.5) / kSize.height;
    for (int x = 0; x < kSize.width; ++x) {
      const double azimuth = 2.0 * std::numbers::pi * ((x + 0.5) / kSize.width - 0.5);  // from -z towards +x
      const glm::dvec3 direction(std::sin(polar) * std::sin(azimuth), std::cos(polar),
                                 -std::sin(polar) * std::cos(azimuth));
      const auto radiance = static_cast<float>(radiance_towards(direction));
      studio.image.at(x, y) = {radiance, radiance, radiance};
    }
  }
  return studio;
}

}  // namespace hpr
