#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "tools/stability/stability.h"
#include "tools/stability/tools.h"
#include "walls/geometry/geometry.h"

namespace hpr::stability {
namespace {

constexpr Size kPixels{1920, 1080};
constexpr double kWidth = 1.0;
constexpr double kHeight = kWidth * kPixels.height / kPixels.width;

/// Where the viewer stands along the screen, from its lower left corner.
struct Beside {
  const char* name;
  double x;
  double y;
};
constexpr std::array<Beside, 3> kBeside{{{"middle", 0.5, 0.28125}, {"near-corner", 0.93, 0.07}, {"outside", 3.1, 0.4}}};

/// The view of a screen a metre wide whose lower left corner is the origin.
View view_of(const Beside& beside, double distance) {
  WallScreen screen;
  screen.id = "a";
  screen.pixels = kPixels;
  screen.lower_right = {kWidth, 0.0, 0.0};
  screen.upper_left = {0.0, kHeight, 0.0};
  Wall wall;
  wall.screens = {screen};
  wall.viewers.front().position = {beside.x, beside.y, distance};
  wall.viewers.front().has_position = true;
  wall.viewers.front().near_m = 0.5 * distance;
  wall.viewers.front().clamp_distance_m = 0.5 * distance;
  Camera camera;
  camera.eye = wall.viewers.front().position;
  return wall_views(wall, camera, {}).front();
}

/// How far from the corners of the picture the corners of the screen are drawn, in pixels, in floats as GL computes.
double corner_error(const Beside& beside, double distance) {
  const View view = view_of(beside, distance);
  const glm::mat4 matrix(clip_from_world(view, view.eye));
  double worst = 0.0;
  for (const double x : {0.0, 1.0}) {
    for (const double y : {0.0, 1.0}) {
      const glm::dvec3 corner = glm::dvec3(x * kWidth, y * kHeight, 0.0) - view.eye;
      const glm::vec4 clip = matrix * glm::vec4(glm::vec3(corner), 1.0F);
      const double px = 0.5 * (static_cast<double>(clip.x / clip.w) + 1.0) * kPixels.width - x * kPixels.width;
      const double py = 0.5 * (static_cast<double>(clip.y / clip.w) + 1.0) * kPixels.height - y * kPixels.height;
      const double error = std::max(std::abs(px), std::abs(py));
      worst = std::isfinite(error) ? std::max(worst, error) : HUGE_VAL;
    }
  }
  return worst;
}

/// Pixels the screen itself, as a surface, leaves open, and those beside where an eighth of it should be drawn.
std::size_t wrong_pixels(Drawer& drawer, const Beside& beside, double distance) {
  const View view = view_of(beside, distance);
  Scene scene;
  // Corners are relative to the eye, so that what is drawn depends on the frustum alone.
  const auto placed = [&](double x, double y) {
    const glm::dmat4 moved = glm::translate(glm::dmat4(1.0), {x, y, 0.0});
    return glm::scale(moved, glm::dvec3(1.0));
  };
  add(scene, rectangle({0.0F, 0.0F}, {static_cast<float>(kWidth), static_cast<float>(kHeight)}), placed(0.0, 0.0));
  finish_scene(scene);
  const Image<Key> whole = drawer.draw(scene, view);
  auto wrong = static_cast<std::size_t>(std::ranges::count(whole.pixels(), kNoKey));
  scene.meshes[0] = {};
  scene = {};
  add(scene, rectangle({0.0F, 0.0F}, {static_cast<float>(kWidth) / 4.0F, static_cast<float>(kHeight) / 2.0F}),
      placed(0.25 * kWidth, 0.0));
  finish_scene(scene);
  const Image<Key> part = drawer.draw(scene, view);
  for (int y = 0; y < kPixels.height; ++y) {
    for (int x = 0; x < kPixels.width; ++x) {
      const bool inside = x >= kPixels.width / 4 && x < kPixels.width / 2 && y >= kPixels.height / 2;
      wrong += (part.at(x, y) != kNoKey) == inside ? 0U : 1U;
    }
  }
  return wrong;
}

std::vector<StabilityFinding> measure_frusta(const Globals& globals) {
  Drawer drawer(globals);
  std::vector<StabilityFinding> findings;
  StabilityFinding drawn = make_finding(
      "frusta/pixels", "a screen a metre wide and an eighth of it, as surfaces, the eye 1 .. 1e-6 m from it", 0.0,
      "pixels wrongly open or covered", "The borders lie half a pixel from any pixel's centre, more than corners err.");
  drawn.curve.x = "distance of the eye, m";
  for (double distance = 1.0; distance > 0.9e-6; distance *= 0.1) drawn.curve.points.emplace_back(distance, 0.0);
  for (const Beside& beside : kBeside) {
    // 2 x / w and the off-axis term, up to 1 + 2 a and 2 a of half the width, take five roundings together.
    const double aside = std::max(std::abs(2.0 * beside.x / kWidth - 1.0), std::abs(2.0 * beside.y / kHeight - 1.0));
    StabilityFinding finding = make_finding(
        fmt::format("frusta/corner-{}", beside.name), "the eye 1 .. 1e-6 m from a screen a metre and 1920 pixels wide",
        0.5 * kPixels.width * 5.0 * kFloatRounding * (1.0 + 2.0 * aside), "pixels",
        "Frusta are derived in double; GL's floats round five times, whatever the distance.");
    finding.curve.x = drawn.curve.x;
    for (auto& [distance, wrong] : drawn.curve.points) {
      const double error = corner_error(beside, distance);
      add_point(finding, distance, error);
      wrong += static_cast<double>(wrong_pixels(drawer, beside, distance));
    }
    std::ranges::reverse(finding.curve.points);
    finding.breaks_at =
        breaking_point_if_any(1e-6, 1e-300, 0.1, [&](double d) { return corner_error(beside, d) <= finding.limit; });
    findings.push_back(finding);
  }
  for (const auto& [distance, wrong] : drawn.curve.points) drawn.measured = std::max(drawn.measured, wrong);
  std::ranges::reverse(drawn.curve.points);
  findings.push_back(drawn);
  return findings;
}

}  // namespace

StabilityCase frusta_case() {
  return {"frusta", "the eye nears the plane of a screen: its corners stay", measure_frusta};
}

}  // namespace hpr::stability
