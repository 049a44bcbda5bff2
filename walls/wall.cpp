#include "walls/wall.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "core/error.h"
#include "walls/toml_document.h"

namespace hpr {
namespace {

std::string point(const glm::dvec3& p) {
  return fmt::format("[{}, {}, {}]", toml_number(p.x), toml_number(p.y), toml_number(p.z));
}

std::string rect(const Rect& r) {
  return fmt::format("[{}, {}, {}, {}]", r.x0, r.y0, r.width(), r.height());
}

std::string node_line(const WallNode& node) {
  std::string gpus;
  for (const std::string& gpu : node.gpus) {
    gpus += fmt::format("{}{{ id = {} }}", gpus.empty() ? "" : ", ", toml_quote(gpu));
  }
  return fmt::format("  {{ id = {}, host = {}{}{} }},\n", toml_quote(node.id), toml_quote(node.host),
                     node.ranks > 0 ? fmt::format(", ranks = {}", node.ranks) : "",
                     gpus.empty() ? "" : fmt::format(", gpus = [{}]", gpus));
}

std::string window_line(const WallWindow& window) {
  std::string line = fmt::format("  {{ id = {}", toml_quote(window.id));
  if (!window.node.empty()) line += ", node = " + toml_quote(window.node);
  if (!window.gpu.empty()) line += ", gpu = " + toml_quote(window.gpu);
  if (window.rank >= 0) line += fmt::format(", rank = {}", window.rank);
  if (!window.display.empty()) line += ", display = " + toml_quote(window.display);
  if (!window.monitor.empty()) line += ", monitor = " + toml_quote(window.monitor);
  if (!window.rect.empty()) line += ", rect = " + rect(window.rect);
  if (window.fullscreen) line += ", fullscreen = true";
  return line + " },\n";
}

std::string screen_line(const WallScreen& screen) {
  std::string line = fmt::format("  {{ id = {}, pixels = [{}, {}], corners_m = {{ ll = {}, lr = {}, ul = {} }}",
                                 toml_quote(screen.id), screen.pixels.width, screen.pixels.height,
                                 point(screen.lower_left), point(screen.lower_right), point(screen.upper_left));
  if (!screen.window.empty()) {
    line += fmt::format(", window = {}, viewport = {}", toml_quote(screen.window), rect(screen.viewport));
  }
  if (screen.rotate != 0) line += fmt::format(", rotate = {}", screen.rotate);
  return line + " },\n";
}

int scaled(int pixels, double factor) {
  constexpr double kMost = 1 << 20;
  return static_cast<int>(std::lround(std::clamp(pixels * factor, 1.0, kMost)));
}

/// Edges are scaled, not sizes, so that neighbours stay neighbours.
Rect scaled(const Rect& r, double factor, Size at_least) {
  const auto edge = [&](int at) { return static_cast<int>(std::lround(at * factor)); };
  const int x = edge(r.x0);
  const int y = edge(r.y0);
  return {x, y, std::max(edge(r.x1), x + at_least.width), std::max(edge(r.y1), y + at_least.height)};
}

}  // namespace

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
    const bool turned = screen.rotate % 180 != 0;
    const Size shown = turned ? Size{screen.pixels.height, screen.pixels.width} : screen.pixels;
    const Rect place = scaled(screen.viewport, factor, shown);
    screen.viewport = {place.x0, place.y0, place.x0 + shown.width, place.y0 + shown.height};
  }
  for (WallWindow& window : wall.windows) {
    if (!window.rect.empty()) window.rect = scaled(window.rect, factor, {1, 1});
  }
  return wall;
}

std::string expand_wall(const Wall& wall) {
  std::string text = fmt::format("hpr_wall = 1\nname = {}\n", toml_quote(wall.name));
  if (!wall.nodes.empty()) {
    text += "nodes = [\n";
    for (const WallNode& node : wall.nodes) text += node_line(node);
    text += "]\n";
  }
  if (!wall.windows.empty()) {
    text += "windows = [\n";
    for (const WallWindow& window : wall.windows) text += window_line(window);
    text += "]\n";
  }
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    const WallScreen& screen = wall.screens[i];
    const bool first = i == 0 || wall.screens[i - 1].surface != screen.surface;
    const bool last = i + 1 == wall.screens.size() || wall.screens[i + 1].surface != screen.surface;
    if (first) text += fmt::format("\n[[surfaces]]\nid = {}\nscreens = [\n", toml_quote(screen.surface));
    text += screen_line(screen);
    if (last) text += "]\n";
  }
  text += "\n[[viewers]]\n";
  if (wall.viewer_given) text += fmt::format("position_m = {}\n", point(wall.viewer));
  if (wall.near_m > 0.0) text += fmt::format("near_m = {}\n", toml_number(wall.near_m));
  text += fmt::format("clamp_distance_m = {}\n", toml_number(wall.clamp_distance_m));
  const Rgba8 gap = wall.gap_color;
  text += fmt::format("\n[test]\ngap_rgba = [{}, {}, {}, {}]\n", gap.r, gap.g, gap.b, gap.a);
  return text;
}

}  // namespace hpr
