#include "rt/lights/punctual_light.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

#include "rt/sampling/sampling.h"

namespace hpr {
namespace {

/// The headlight stands a little above and beside the eye, the same way for every screen of a wall: straight from the
/// eye, rough metal would look flat, as its reflectance and the cosine cancel there.
constexpr glm::dvec3 kHeadlightLift{0.25, 0.4, 0.1};

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The spot's ramp over the cosine off its axis: zero at `foot`, and one where it would be `width` higher.
struct SpotRamp {
  double foot = 0.0;
  double width = 1.0;

  explicit SpotRamp(const Light& light)
      : foot(std::cos(static_cast<double>(light.outer_cone_radians))),
        width(std::max(0.001, std::cos(static_cast<double>(light.inner_cone_radians)) - foot)) {}

  [[nodiscard]] double value(double cosine) const {
    const double ramp = std::clamp((cosine - foot) / width, 0.0, 1.0);
    return ramp * ramp;
  }
  /// Where the ramp ends; a narrow spot's never reaches one.
  [[nodiscard]] double top() const { return std::min(1.0, foot + width); }
  [[nodiscard]] double slope_integral() const {
    const double rise = top() - foot;
    return rise * rise * rise / (3.0 * width * width);
  }
  /// Over all cosines; times 2 pi: over all directions.
  [[nodiscard]] double integral() const { return 1.0 - top() + slope_integral(); }
  /// A cosine with the density value / integral; 1 for u = 0.
  [[nodiscard]] double sample(double u) const {
    const double from_top = u * integral();
    const double flat = 1.0 - top();
    if (from_top < flat) return 1.0 - from_top;
    const double rest = std::max(0.0, 1.0 - (from_top - flat) / slope_integral());
    return foot + (top() - foot) * std::cbrt(rest);
  }
};

/// 1 - cos of half the angle a directional light is seen under.
double opening_of(const Light& light) {
  const double half =
      std::sin(0.5 * std::clamp(static_cast<double>(light.angular_radius_radians), 0.0, 0.5 * std::numbers::pi));
  return 2.0 * half * half;
}

/// Its irradiance on a plane that always faces the sampled direction: the disc's integral of the cosine is
/// pi sin^2, that of one is 2 pi (1 - cos).
glm::dvec3 facing_irradiance(const Light& light) {
  return glm::dvec3(light.intensity) * (2.0 / (2.0 - opening_of(light)));
}

LightSample sample_directional(const Light& light, const glm::dvec2& u) {
  LightSample sample;
  sample.to_light = -glm::normalize(glm::dvec3(light.direction));
  if (!is_fixed(light)) sample.to_light = warp::in_cone(sample.to_light, opening_of(light), u);
  sample.distance = kInfinity;
  sample.weight = facing_irradiance(light);
  return sample;
}

LightSample sample_headlight(const Light& light, const glm::dvec3& position, const View& view) {
  LightSample sample;
  sample.casts_shadows = false;
  if (view.orthographic) {
    sample.to_light = glm::normalize(view.axes[2] + kHeadlightLift);
    sample.distance = kInfinity;
    sample.weight = glm::dvec3(light.intensity);
    return sample;
  }
  const glm::dvec3 to_eye = view.eye - position;
  sample.distance = glm::length(to_eye);
  sample.goal = view.eye;
  if (!(sample.distance > 0.0) || !std::isfinite(sample.distance)) return sample;
  sample.to_light = glm::normalize(to_eye / sample.distance + kHeadlightLift);
  sample.weight = glm::dvec3(light.intensity);
  return sample;
}

}  // namespace

double range_window(double distance, double range) {
  if (range <= 0.0) return 1.0;
  const double ratio = distance / range;
  return std::clamp(1.0 - ratio * ratio * ratio * ratio, 0.0, 1.0);
}

LightSample sample_punctual(const Light& light, const glm::dvec3& position, const View& view, const glm::dvec2& u) {
  if (light.type == LightType::Directional) return sample_directional(light, u);
  if (light.type == LightType::Headlight) return sample_headlight(light, position, view);
  LightSample sample;
  const glm::dvec3 to_center = light.position - position;
  const double distance = glm::length(to_center);
  sample.distance = distance;
  sample.goal = light.position;
  if (!(distance > light.radius) || !std::isfinite(distance)) return sample;
  sample.to_light = to_center / distance;
  double cosine = 1.0;  // of half the angle the sphere is seen under
  if (light.radius > 0.0) {
    const double sine = light.radius / distance;
    cosine = std::sqrt((distance - light.radius) / distance * (1.0 + sine));
    const double opening = sine * sine / (1.0 + cosine);
    const double below = opening * u.x;
    sample.to_light = warp::in_cone(sample.to_light, opening, u);
    // Half the chord inside the sphere: (r sin)^2 of the angle at the place, taken from r^2 without cancelling much.
    const double off_axis = distance * std::sqrt(below * (2.0 - below));
    const double half_chord = std::sqrt(std::max(0.0, (light.radius - off_axis) * (light.radius + off_axis)));
    sample.distance = std::max(0.0, distance * (1.0 - below) - half_chord);
    sample.goal = position + sample.distance * sample.to_light;
  }
  // Radiance, I / (pi r^2), times the solid angle of the cone, 2 pi sin^2 / (1 + cos): the radius cancels.
  double strength = range_window(distance, light.range) * 2.0 / (distance * distance * (1.0 + cosine));
  if (light.type == LightType::Spot) {
    strength *= SpotRamp(light).value(-glm::dot(glm::dvec3(light.direction), sample.to_light));
  }
  if (std::isfinite(strength)) sample.weight = glm::dvec3(light.intensity) * strength;
  return sample;
}

bool is_fixed(const Light& light) {
  switch (light.type) {
    case LightType::Headlight:
      return true;
    case LightType::Directional:
      return !(light.angular_radius_radians > 0.0F);
    case LightType::Point:
    case LightType::Spot:
      break;
  }
  return !(light.radius > 0.0);
}

glm::dvec3 power_of(const Light& light, const LitSphere& lit) {
  const glm::dvec3 intensity(light.intensity);
  switch (light.type) {
    case LightType::Point:
      return 4.0 * std::numbers::pi * intensity;
    case LightType::Spot:
      return 2.0 * std::numbers::pi * SpotRamp(light).integral() * intensity;
    case LightType::Directional:
      return std::numbers::pi * lit.radius * lit.radius * facing_irradiance(light);
    case LightType::Headlight:
      break;
  }
  return glm::dvec3(0.0);
}

PhotonStart emit_from_outside(const LitSphere& lit, const glm::dvec3& direction, const glm::dvec3& flux,
                              const glm::dvec2& u_place) {
  PhotonStart start;
  const glm::dvec2 across = lit.radius * warp::in_disc(u_place);
  start.origin = lit.center + warp::basis_about(direction) * glm::dvec3(across, -lit.radius);
  start.direction = direction;
  start.flux = flux;
  start.endless = true;
  return start;
}

PhotonStart emit_punctual(const Light& light, const LitSphere& lit, const glm::dvec2& u_place,
                          const glm::dvec2& u_direction) {
  const glm::dvec3 flux = power_of(light, lit);
  if (light.type == LightType::Directional) {
    const LightSample sample = sample_directional(light, u_direction);
    return emit_from_outside(lit, -sample.to_light, flux, u_place);
  }
  PhotonStart start;
  start.origin = light.position;
  start.center = light.position;
  start.range = light.range;
  start.flux = flux;
  start.direction = light.type == LightType::Spot
                        ? warp::in_cone(glm::normalize(glm::dvec3(light.direction)),
                                        1.0 - SpotRamp(light).sample(u_direction.x), {1.0, u_direction.y})
                        : warp::on_sphere(u_direction);
  if (light.radius > 0.0) {
    // A sphere of uniform radiance looks like a uniform disc from everywhere: its photons leave the side they go to.
    const glm::dvec3 on_front(warp::in_disc(u_place), std::sqrt(std::max(0.0, 1.0 - u_place.x)));
    start.origin += light.radius * (warp::basis_about(start.direction) * on_front);
  }
  return start;
}

Light make_headlight() {
  Light headlight;
  headlight.name = "headlight";
  headlight.type = LightType::Headlight;
  headlight.intensity = glm::vec3(std::numbers::pi_v<float>);
  return headlight;
}

}  // namespace hpr
