#include "walls/config/wall.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "core/error.h"
#include "walls/config/toml_document.h"

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

std::string color_table(const PanelColor& color) {
  return fmt::format("{{ gamma = {}, gain = {}, black = {} }}", point(color.gamma), point(color.gain),
                     point(color.black));
}

std::string blend_table(const EdgeBlend& blend) {
  if (blend.automatic) return fmt::format("{{ auto = true, gamma = {} }}", toml_number(blend.gamma));
  return fmt::format("{{ left = {}, right = {}, bottom = {}, top = {}, gamma = {} }}", toml_number(blend.left),
                     toml_number(blend.right), toml_number(blend.bottom), toml_number(blend.top),
                     toml_number(blend.gamma));
}

std::string warp_table(const ScreenWarp& warp) {
  std::string text;
  const std::pair<const char*, const WarpFile*> files[] = {
      {"mesh", &warp.mesh}, {"blend", &warp.blend}, {"black", &warp.black}};
  for (const auto& [key, file] : files) {
    if (!file->path.empty()) text += fmt::format("{}{} = {}", text.empty() ? "" : ", ", key, toml_quote(file->path));
  }
  return fmt::format("{{ {} }}", text);
}

template <typename Choice>
std::string name_in(const std::vector<std::string>& names, Choice choice) {
  return toml_quote(names.at(static_cast<std::size_t>(choice)));
}

std::string screen_line(const WallScreen& screen) {
  std::string line = fmt::format("  {{ id = {}, pixels = [{}, {}], corners_m = {{ ll = {}, lr = {}, ul = {} }}",
                                 toml_quote(screen.id), screen.pixels.width, screen.pixels.height,
                                 point(screen.lower_left), point(screen.lower_right), point(screen.upper_left));
  if (!screen.window.empty()) {
    line += fmt::format(", window = {}, viewport = {}", toml_quote(screen.window), rect(screen.viewport));
  }
  if (screen.rotate != 0) line += fmt::format(", rotate = {}", screen.rotate);
  if (screen.mirror != Mirror::None) line += ", mirror = " + name_in(mirror_names(), screen.mirror);
  if (screen.eye != Eye::Both) line += ", eye = " + name_in(eye_names(), screen.eye);
  if (screen.color != PanelColor{}) line += ", colour = " + color_table(screen.color);
  if (screen.blend.any()) line += ", edge_blend_m = " + blend_table(screen.blend);
  if (screen.warp.any()) line += ", warp = " + warp_table(screen.warp);
  return line + " },\n";
}

std::string tracker_table(const WallTracker& tracker) {
  if (tracker.kind == WallTracker::Kind::File) {
    return fmt::format("{{ type = \"file\", path = {}, rate_hz = {} }}", toml_quote(tracker.path),
                       toml_number(tracker.rate_hz));
  }
  return fmt::format(R"({{ type = "udp", address = {}, port = {}, lost = {{ after_ms = {}, then = "{}" }} }})",
                     toml_quote(tracker.address), tracker.port, tracker.lost_after_ms,
                     tracker.lost_then == WallTracker::Lost::Freeze ? "freeze" : "rest");
}

std::string viewer_table(const WallViewer& viewer) {
  std::string text = "\n[[viewers]]\n";
  if (!viewer.id.empty()) text += fmt::format("id = {}\n", toml_quote(viewer.id));
  if (viewer.given) text += fmt::format("position_m = {}\n", point(viewer.position));
  if (viewer.ipd_m > 0.0) text += fmt::format("ipd_m = {}\n", toml_number(viewer.ipd_m));
  if (viewer.eye_offset != glm::dvec3(0.0)) text += fmt::format("eye_offset_m = {}\n", point(viewer.eye_offset));
  if (viewer.near_m > 0.0) text += fmt::format("near_m = {}\n", toml_number(viewer.near_m));
  text += fmt::format("clamp_distance_m = {}\n", toml_number(viewer.clamp_distance_m));
  if (viewer.tracker.kind != WallTracker::Kind::None) {
    text += fmt::format("tracker = {}\n", tracker_table(viewer.tracker));
  }
  return text;
}

/// The surfaces with their screens, which stand together.
std::string surface_tables(const Wall& wall) {
  std::string text;
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    const WallScreen& screen = wall.screens[i];
    const bool first = i == 0 || wall.screens[i - 1].surface != screen.surface;
    const bool last = i + 1 == wall.screens.size() || wall.screens[i + 1].surface != screen.surface;
    if (first) {
      text += fmt::format("\n[[surfaces]]\nid = {}\n", toml_quote(screen.surface));
      if (screen.viewer > 0) text += fmt::format("viewer = {}\n", toml_quote(wall.viewers.at(screen.viewer).id));
      text += "screens = [\n";
    }
    text += screen_line(screen);
    if (last) text += "]\n";
  }
  return text;
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
    const Rect place = scaled(screen.viewport, factor, shown);
    screen.viewport = {place.x0, place.y0, place.x0 + shown.width, place.y0 + shown.height};
  }
  for (WallMonitor& monitor : wall.monitors) {
    monitor.pixels = {scaled(monitor.pixels.width, factor), scaled(monitor.pixels.height, factor)};
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
  if (wall.stereo != StereoMode::None) {
    text += fmt::format("stereo = {{ mode = {} }}\n", name_in(stereo_names(), wall.stereo));
  }
  if (!wall.monitors.empty()) {
    text += "monitors = [\n";
    for (const WallMonitor& monitor : wall.monitors) {
      text += fmt::format("  {{ id = {}, surface = {}, pixels = [{}, {}] }},\n", toml_quote(monitor.id),
                          toml_quote(monitor.surface), monitor.pixels.width, monitor.pixels.height);
    }
    text += "]\n";
  }
  text += surface_tables(wall);
  for (const WallViewer& viewer : wall.viewers) text += viewer_table(viewer);
  const Rgba8 gap = wall.gap_color;
  text += fmt::format("\n[test]\ngap_rgba = [{}, {}, {}, {}]\n", gap.r, gap.g, gap.b, gap.a);
  return text;
}

}  // namespace hpr
