#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "scene/scene.h"
#include "scene/view.h"

namespace hpr {

/// What arrives from a light at a place.
struct LightSample {
  glm::dvec3 to_light{0.0};    ///< unit length
  double distance = 0.0;       ///< metres; infinite for directional lights
  glm::dvec3 irradiance{0.0};  ///< W/m^2 on a plane that faces the light; zero where it does not reach
};

/// KHR_lights_punctual: W/sr over the squared distance (point, spot), windowed by the range; W/m^2 (directional); the
/// spot's ramp is the squared one the extension recommends. A light right on the place gives nothing, not infinity.
[[nodiscard]] LightSample sample_light(const Light& light, const glm::dvec3& place, const View& view);

/// Only real lights cast shadows; the headlight is so near the eye that it could show few.
[[nodiscard]] inline bool casts_shadows(const Light& light) {
  return light.type != LightType::Headlight;
}

/// The scene's lights, or one headlight under which a white wall that faces the eye has a radiance of about 0.9.
[[nodiscard]] std::vector<Light> lights_or_headlight(const Scene& scene);

}  // namespace hpr
