#include "walls/config/wall.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "core/error.h"

namespace hpr {
namespace {

int scaled(int pixels, double factor) {
  constexpr double kMaxPixels = 1 << 20;
  return static_cast<int>(std::lround(std::clamp(pixels * factor, 1.0, kMaxPixels)));
}

/// Edges are scaled, not sizes, so that neighbours stay neighbours.
Rect scaled(const Rect& r, double factor, Size at_least) {
  const auto edge = [&](int at) { return static_cast<int>(std::lround(at * factor)); };
  const int x = edge(r.x0);
  const int y = edge(r.y0);
  return {x, y, std::max(edge(r.x1), x + at_least.width), std::max(edge(r.y1), y + at_least.height)};
}

}  // namespace

const std::vector<std::string>& stereo_names() {
  static const std::vector<std::string> names{"none", "passive", "side-by-side", "top-bottom", "anaglyph"};
  return names;
}

const std::vector<std::string>& eye_names() {
  static const std::vector<std::string> names{"both", "left", "right"};
  return names;
}

const std::vector<std::string>& mirror_names() {
  static const std::vector<std::string> names{"none", "horizontal", "vertical"};
  return names;
}

Size panel_pixels(const WallScreen& screen) {
  return screen.rotate % 180 != 0 ? Size{screen.pixels.height, screen.pixels.width} : screen.pixels;
}

double screen_width(const WallScreen& screen) {
  return glm::length(screen.lower_right - screen.lower_left);
}

double screen_height(const WallScreen& screen) {
  return glm::length(screen.upper_left - screen.lower_left);
}

Wall scale_wall(Wall wall, double factor) {
  if (!(factor > 0.0) || !std::isfinite(factor)) {
    throw Error(ExitCode::Usage, fmt::format("a wall cannot be scaled by {}", factor), "give a positive number");
  }
  for (WallScreen& screen : wall.screens) {
    screen.pixels = {scaled(screen.pixels.width, factor), scaled(screen.pixels.height, factor)};
    // Two eyes need a pixel each.
    if (screen.eye == Eye::Both && wall.stereo == StereoMode::SideBySide)
      screen.pixels.width = std::max(2, screen.pixels.width);
    if (screen.eye == Eye::Both && wall.stereo == StereoMode::TopBottom)
      screen.pixels.height = std::max(2, screen.pixels.height);
    const Size shown = panel_pixels(screen);
    const Rect viewport = scaled(screen.viewport, factor, shown);
    screen.viewport = {viewport.x0, viewport.y0, viewport.x0 + shown.width, viewport.y0 + shown.height};
  }
  for (WallMonitor& monitor : wall.monitors) {
    monitor.pixels = {scaled(monitor.pixels.width, factor), scaled(monitor.pixels.height, factor)};
  }
  for (WallWindow& window : wall.windows) {
    if (!window.rect.empty()) window.rect = scaled(window.rect, factor, {1, 1});
  }
  return wall;
}

}  // namespace hpr
