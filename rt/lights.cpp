#include "rt/lights.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

namespace hpr {
namespace {

/// The headlight stands a little above and beside the eye, the same way for every screen of a wall: straight from the
/// eye, rough metal would look flat, as its reflectance and the cosine cancel there.
constexpr glm::dvec3 kHeadlightLift{0.25, 0.4, 0.1};

/// The window that brings a light to zero at its range, as the extension recommends.
double range_window(double distance, double range) {
  if (range <= 0.0) return 1.0;
  const double ratio = distance / range;
  return std::clamp(1.0 - ratio * ratio * ratio * ratio, 0.0, 1.0);
}

double spot_window(const Light& light, const glm::dvec3& to_light) {
  const double cos_inner = std::cos(static_cast<double>(light.inner_cone_radians));
  const double cos_outer = std::cos(static_cast<double>(light.outer_cone_radians));
  const double cosine = -glm::dot(glm::dvec3(light.direction), to_light);
  const double ramp = std::clamp((cosine - cos_outer) / std::max(0.001, cos_inner - cos_outer), 0.0, 1.0);
  return ramp * ramp;
}

}  // namespace

LightSample sample_light(const Light& light, const glm::dvec3& place, const View& view) {
  LightSample sample;
  const glm::dvec3 intensity(light.intensity);
  if (light.type == LightType::Directional) {
    sample.to_light = -glm::normalize(glm::dvec3(light.direction));
    sample.distance = std::numeric_limits<double>::infinity();
    sample.irradiance = intensity;
    return sample;
  }
  const bool headlight = light.type == LightType::Headlight;
  if (headlight && view.orthographic) {
    sample.to_light = glm::normalize(view.axes[2] + kHeadlightLift);
    sample.distance = std::numeric_limits<double>::infinity();
    sample.irradiance = intensity;
    return sample;
  }
  const glm::dvec3 way = (headlight ? view.eye : light.position) - place;
  sample.distance = glm::length(way);
  if (!(sample.distance > 0.0) || !std::isfinite(sample.distance)) return sample;
  sample.to_light = way / sample.distance;
  if (headlight) sample.to_light = glm::normalize(sample.to_light + kHeadlightLift);
  if (headlight) {
    sample.irradiance = intensity;
    return sample;
  }
  double strength = range_window(sample.distance, light.range) / (sample.distance * sample.distance);
  if (light.type == LightType::Spot) strength *= spot_window(light, sample.to_light);
  if (std::isfinite(strength)) sample.irradiance = intensity * strength;
  return sample;
}

std::vector<Light> lights_or_headlight(const Scene& scene) {
  if (!scene.lights.empty()) return scene.lights;
  Light headlight;
  headlight.name = "headlight";
  headlight.type = LightType::Headlight;
  headlight.intensity = glm::vec3(std::numbers::pi_v<float>);
  return {headlight};
}

}  // namespace hpr
