#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "tools/stability/cases.h"
#include "tools/stability/tools.h"

namespace hpr::stability {
namespace {

constexpr Size kSize{1024, 16};
constexpr double kNear = 0.01;

/// How far from the line in which they cross a pixel shows the farther of two planes: one faces the eye at `distance`,
/// the other is turned by `angle` about an upright line beside the middle.
double line_error(Drawer& drawer, double distance, double angle) {
  const double line = 0.137 * distance;
  const auto placed = [&](double turned) {
    const glm::dmat4 moved = glm::translate(glm::dmat4(1.0), {line, 0.0, -distance});
    return glm::scale(glm::rotate(moved, turned, glm::dvec3(0.0, 1.0, 0.0)), glm::dvec3(distance));
  };
  Scene scene;
  add(scene, rectangle({-1.4F, -0.5F}, {1.4F, 0.5F}), placed(0.0));
  add(scene, rectangle({-1.4F, -0.5F}, {1.4F, 0.5F}), placed(angle));
  finish_scene(scene);
  const View view = head_on(kSize, 1.0, kNear);
  const Image<Key> keys = drawer.draw(scene, view);
  double farthest = 0.0;
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      // Where the pixel's ray meets the turned plane: `along` from the line, nearer than the other plane if negative.
      const double slope = -1.0 + 2.0 * (x + 0.5) / kSize.width;
      const double along = (slope * distance - line) / (std::cos(angle) - slope * std::sin(angle));
      const bool turned_seen = keys.at(x, y) != kNoKey && key_surface(keys.at(x, y)) >= 2;
      const bool turned_nearer = along < 0.0;
      if (keys.at(x, y) == kNoKey || turned_seen != turned_nearer) farthest = std::max(farthest, std::abs(along));
    }
  }
  return farthest;
}

/// Roundings, in units of 2^-24, in the depths of the two planes: docs/numerics.md.
double roundings(double angle) {
  return 13.0 + 60.0 * std::sin(angle);
}

}  // namespace

std::vector<StabilityFinding> crossing_planes(const Globals& globals) {
  Drawer drawer(globals);
  StabilityFinding finding;
  finding.name = "crossing/line";
  finding.parameter = "angle 1e-1 .. 1e-5 rad at 1, 100 and 10 000 m: distance from the true line x sin(angle) / depth";
  finding.unit = "relative";
  finding.limit = roundings(0.1) * kFloatRounding;
  finding.why = "The planes lie x sin(angle) apart beside their line; depth takes 13 + 60 sin(angle) roundings.";
  finding.curve.x = "angle, rad";
  for (const double angle : {1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1}) {
    double worst = 0.0;
    for (const double distance : {1.0, 100.0, 1e4}) {
      worst = std::max(worst, line_error(drawer, distance, angle) * std::sin(angle) / distance);
    }
    finding.curve.points.emplace_back(angle, worst);
    finding.curve.expected.emplace_back(angle, roundings(angle) * kFloatRounding);
    finding.measured = std::max(finding.measured, worst);
  }
  return {finding};
}

}  // namespace hpr::stability
