#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <vector>

#include "tools/stability/stability.h"
#include "tools/stability/tools.h"

// Lights where formulas have their poles and zeros: on a surface, as small as a point from afar, and at the horizon.
namespace hpr::stability {
namespace {

constexpr double kPi = std::numbers::pi;

/// A white floor, y = 0, two metres wide.
Scene floor_under(const Light& light) {
  Scene scene;
  add_placed(scene, parallelogram({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}), diffuse(), glm::dmat4(1.0));
  scene.lights = {light};
  finish_scene(scene);
  return scene;
}

double floors_radiance(const Scene& scene, const std::vector<PassId>& passes) {
  return glanced(scene, glance(scene, {0.3, 1.0, 0.5}, {0.0, 0.0, 0.0}), only(passes));
}

double relative(double measured, double expected) {
  return std::abs(measured / expected - 1.0);
}

StabilityFinding near_surface() {
  StabilityFinding near =
      make_finding("lights/near-surface", "a point light 1 .. 1e-6 m above a floor of 2 m, with shadows", 0.0,
                   "relative", "the distance is a difference of numbers about 1, off by 2^-52 each");
  constexpr double kNearest = 1e-6;
  const auto limit = [](double height) { return kFloatRounding + 16.0 * kDoubleRounding * (1.0 + 1.0 / height); };
  near.limit = limit(kNearest);
  near.curve.x = "height, m";
  const auto error = [](double height) {
    Light light;
    light.position = {0.0, height, 0.0};
    light.intensity = glm::vec3(1e-6F);
    const double intensity = light.intensity.r;
    return relative(floors_radiance(floor_under(light), {PassId::Shadow}), intensity / (kPi * height * height));
  };
  for (const double height : {1e-9, 1e-8, 1e-7, kNearest, 1e-5, 1e-4, 1e-2, 1.0}) {
    const double off = error(height);
    add_point(near, height, off, height >= kNearest);
    near.curve.expected.emplace_back(height, limit(height));
  }
  const auto holds = [&](double height) { return error(height) <= near.limit; };
  near.breaks_at = breaking_point_if_any(kNearest, 1e-18, 0.2, holds);
  return near;
}

StabilityFinding on_surface(int threads) {
  StabilityFinding on =
      make_finding("lights/on-surface", "lights of radius 0 and 1e-3 m at distance 0 and in the eye", 0.0,
                   "pixels without finite radiance",
                   "a light has no weight on its own place, and 1e-18 m off its light still fits a float");
  for (const double radius : {0.0, 1e-3}) {
    for (const double height : {0.0, 1e-300, 1e-18, -1e-18, 0.5}) {
      Light light;
      light.position = {0.0, height, 0.0};
      light.radius = radius;
      const Scene scene = floor_under(light);
      const View view = make_view(look_at({0.0, 0.5, 0.0}, {0.0, 0.0, 0.0}, {0, 0, 1}, 0.8), {65, 65}, scene.bounds);
      on.measured += static_cast<double>(lit_picture(scene, view, only({PassId::Shadow}, threads)).counts.not_finite);
    }
  }
  return on;
}

/// A sphere or a triangle of `size` metres, one metre from the floor at 45 degrees, against a point light there.
double off_the_point(bool sphere, double size) {
  Light light;
  const glm::dvec3 position = glm::normalize(glm::dvec3(1.0, 1.0, 0.0));
  light.position = position;
  const Scene point = floor_under(light);
  double expected = floors_radiance(point, {});
  if (sphere) {
    light.radius = size;
    return relative(floors_radiance(floor_under(light), {}), expected);
  }
  // A triangle that faces the floor's middle: radiance times area is what a point light has as intensity.
  const glm::dvec3 a = glm::normalize(glm::dvec3(1.0, -1.0, 0.0)) * size;
  const glm::dvec3 b = glm::dvec3(0.0, 0.0, 1.0) * size;
  Scene scene;
  add_placed(scene, parallelogram({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}), diffuse(), glm::dmat4(1.0));
  Mesh triangle;
  triangle.positions = {glm::vec3(0.0F), glm::vec3(a), glm::vec3(b)};
  triangle.triangles = {{0, 1, 2}};
  Material glowing = diffuse(glm::vec3(0.0F));
  const auto area = static_cast<float>(0.5 * size * size);
  glowing.emissive = glm::vec3(1.0F / area);
  glm::dmat4 to_position(1.0);
  to_position[3] = glm::dvec4(position - (a + b) / 3.0, 1.0);
  add_placed(scene, std::move(triangle), glowing, to_position);
  finish_scene(scene);
  return relative(floors_radiance(scene, {}), expected);
}

StabilityFinding far_away(bool sphere) {
  StabilityFinding far = make_finding(
      sphere ? "lights/far-sphere" : "lights/far-triangle",
      "size 1e-1 .. 1e-6 of the distance, at 45 degrees, one sample, against a point light", 1.0,
      "of what a light of that size may be off", "one sample of a light of size q sees cosine and distance off by q");
  // d(cos / r^2) <= (tan 45 + 2) q to first order, corners reaching up to sqrt(2) q about the middle; then floats.
  const auto limit = [](double q) { return 3.0 * std::sqrt(2.0) * q * (1.0 + 2.0 * q) + 8.0 * kFloatRounding; };
  constexpr double kMinSize = 1e-6;
  far.curve.x = "size over distance";
  for (const double q : {1e-9, kMinSize, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1}) {
    const double off = off_the_point(sphere, q);
    if (q >= kMinSize) far.measured = worse(far.measured, off / limit(q));
    far.curve.points.emplace_back(q, off);
    far.curve.expected.emplace_back(q, limit(q));
  }
  // Smaller lights still are points.
  const auto holds = [&](double q) { return off_the_point(sphere, q) <= limit(kMinSize); };
  far.breaks_at = breaking_point_if_any(kMinSize, 1e-18, 0.2, holds);
  return far;
}

double at_elevation(double radians) {
  Light light;
  light.type = LightType::Directional;
  light.direction = glm::vec3(static_cast<float>(-std::cos(radians)), static_cast<float>(-std::sin(radians)), 0.0F);
  return floors_radiance(floor_under(light), {});
}

StabilityFinding horizon() {
  StabilityFinding low =
      make_finding("lights/horizon", "a directional light 1 .. 1e-6 radians above the horizon", 4.0 * kFloatRounding,
                   "relative", "its direction is stored in floats, which keep their digits near 0");
  low.curve.x = "elevation, radians";
  const auto error = [](double radians) { return relative(at_elevation(radians), std::sin(radians) / kPi); };
  for (const double radians : {1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2, 1.0}) {
    const double off = error(radians);
    add_point(low, radians, off, radians >= 1e-6);
  }
  for (const double radians : {0.0, -1e-30, -1e-3}) low.measured = worse(low.measured, at_elevation(radians));
  low.breaks_at = breaking_point_if_any(1e-6, 1e-12, 0.1, [&](double radians) { return error(radians) <= low.limit; });
  return low;
}

std::vector<StabilityFinding> measure_lights(const Globals& globals) {
  return {near_surface(), on_surface(threads_of(globals)), far_away(true), far_away(false), horizon()};
}

}  // namespace

StabilityCase lights_case() {
  return {"lights", "lights on a surface, as small as a point, at the horizon", measure_lights};
}

}  // namespace hpr::stability
