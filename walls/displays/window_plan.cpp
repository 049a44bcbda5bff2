#include "walls/displays/window_plan.h"

#include <algorithm>

#include "walls/geometry.h"

namespace hpr {
namespace {

/// Larger desktops are rare; windows are placed on it, not scaled.
constexpr int kLargestDesktop = 1 << 16;

Size shown_size(const WallScreen& screen) {
  return screen.rotate % 180 == 0 ? screen.pixels : Size{screen.pixels.height, screen.pixels.width};
}

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
    Pane pane{index, screen.viewport, screen.rotate, screen_height(screen) / screen.pixels.height / wall_height};
    const auto window = std::ranges::find(wall.windows, screen.window, &WallWindow::id);
    if (screen.window.empty() || window == wall.windows.end()) {
      const Rect place = picture.screens[index];
      pane.place = at(0, 0, shown_size(screen));
      plans.push_back(
          {screen.id, at(place.x0, place.y0, shown_size(screen)), false, true, {}, {}, std::vector<Pane>{pane}});
      continue;
    }
    const auto known = std::ranges::find(plans, window->id, &WindowPlan::title);
    if (known != plans.end()) {
      known->panes.push_back(pane);
      continue;
    }
    plans.push_back({window->id, window->rect, window->fullscreen, window->rect.empty() && !window->fullscreen,
                     window->monitor, window->display, std::vector<Pane>{pane}});
  }
  for (WindowPlan& plan : plans) {
    if (plan.rect.empty()) plan.rect = around(plan.panes);
  }
  return plans;
}

}  // namespace hpr
