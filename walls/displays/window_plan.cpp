#include "walls/displays/window_plan.h"

#include <algorithm>

#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

/// Larger desktops are rare; windows are placed on it, not scaled.
constexpr int kLargestDesktop = 1 << 16;

Rect at(int x, int y, Size size) {
  return {x, y, x + size.width, y + size.height};
}

/// As large as its screens where the wall file gives no size.
Rect around(const std::vector<Pane>& panes) {
  Rect rect;
  for (const Pane& pane : panes) {
    rect.x1 = std::max(rect.x1, pane.place.x1);
    rect.y1 = std::max(rect.y1, pane.place.y1);
  }
  return rect;
}

}  // namespace

std::vector<WindowPlan> plan_windows(const Wall& wall, const std::vector<std::size_t>& screens) {
  const WallPicture picture = wall_picture(wall, kLargestDesktop);
  const double wall_height = std::max(wall_extent(wall).height, 1e-9);
  std::vector<WindowPlan> plans;
  for (const std::size_t index : screens) {
    const WallScreen& screen = wall.screens.at(index);
    Pane pane{index, screen.viewport, screen.rotate, screen.mirror,
              screen_height(screen) / screen.pixels.height / wall_height};
    const auto window = std::ranges::find(wall.windows, screen.window, &WallWindow::id);
    if (screen.window.empty() || window == wall.windows.end()) {
      const Rect place = picture.screens[index];
      pane.place = at(0, 0, panel_pixels(screen));
      plans.push_back({.title = screen.id,
                       .window = {},
                       .rect = at(place.x0, place.y0, panel_pixels(screen)),
                       .decorated = true,
                       .monitor = {},
                       .display = {},
                       .panes = {pane}});
      continue;
    }
    const auto known = std::ranges::find(plans, window->id, &WindowPlan::window);
    if (known != plans.end()) {
      known->panes.push_back(pane);
      continue;
    }
    plans.push_back({.title = window->id,
                     .window = window->id,
                     .rect = window->rect,
                     .fullscreen = window->fullscreen,
                     .decorated = window->rect.empty() && !window->fullscreen,
                     .monitor = window->monitor,
                     .display = window->display,
                     .panes = {pane}});
  }
  for (WindowPlan& plan : plans) {
    if (plan.rect.empty()) plan.rect = around(plan.panes);
  }
  return plans;
}

std::optional<std::size_t> pane_at(const WindowPlan& plan, const glm::dvec2& place) {
  for (std::size_t i = 0; i < plan.panes.size(); ++i) {
    const Rect& pane = plan.panes[i].place;
    if (place.x >= pane.x0 && place.x < pane.x1 && place.y >= pane.y0 && place.y < pane.y1) return i;
  }
  return std::nullopt;
}

glm::dvec2 upright(const Pane& pane, const glm::dvec2& way) {
  glm::dvec2 turned = way;
  if (pane.mirror == Mirror::Horizontal) turned.x = -turned.x;
  if (pane.mirror == Mirror::Vertical) turned.y = -turned.y;
  // A clockwise quarter turn takes what goes right in the picture down on the pane.
  for (int degrees = pane.rotate; degrees > 0; degrees -= 90) turned = {turned.y, -turned.x};
  return turned;
}

}  // namespace hpr
