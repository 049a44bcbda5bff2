#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <map>

#include "core/error.h"
#include "core/log.h"
#include "core/text.h"
#include "walls/displays/display.h"
#include "walls/displays/window_plan.h"
#include "walls/displays/window_thread.h"
#include "walls/drawing/panel_transform.h"
#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

/// Larger desktops are rare; windows are placed on it, not scaled.
constexpr int kMaxDesktopSide = 1 << 16;

Rect at(int x, int y, Size size) {
  return {x, y, x + size.width, y + size.height};
}

/// The rectangle of a window on its desktop: as large as its screens where the wall file gives no size.
Rect around(const std::vector<Pane>& panes) {
  Rect rect;
  for (const Pane& pane : panes) {
    rect.x1 = std::max(rect.x1, pane.rect.x1);
    rect.y1 = std::max(rect.y1, pane.rect.y1);
  }
  return rect;
}

std::vector<std::size_t> screens_or_all(const Wall& wall, const DisplayOptions& options) {
  if (options.screens) return *options.screens;
  std::vector<std::size_t> all(wall.screens.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
  return all;
}

/// GLFW opens the display DISPLAY names, and one only.
void choose_x_display(const std::vector<WindowPlan>& plans) {
  HPR_CHECK(!plans.empty());
  const std::string& wanted = plans.front().display;
  for (const WindowPlan& plan : plans) {
    if (plan.display == wanted) continue;
    throw Error(ExitCode::BadInput,
                fmt::format("the windows '{}' and '{}' are on the displays '{}' and '{}', but one rank opens both",
                            plans.front().title, plan.title, printable(wanted), printable(plan.display)),
                "give each X display a rank of its own: rank = 0, rank = 1, ...");
  }
  // NOLINTNEXTLINE(concurrency-mt-unsafe): the one thread that reads it is not yet started
  if (!wanted.empty()) setenv("DISPLAY", wanted.c_str(), 1);
}

/// Windows on this host's desktop, by GLFW: one per window of the wall file, or one per screen. Closing one, or Escape,
/// ends the run; the mouse moves the camera.
class WindowDisplay final : public Display {
 public:
  WindowDisplay(const Wall& wall, const std::vector<WindowPlan>& plans) : wall_(wall), plans_(plans), windows_(plans) {}

  [[nodiscard]] std::string_view name() const override { return "window"; }

  void show(const WallFrame& frame) override {
    std::vector<PanePicture> pictures;
    for (std::size_t window = 0; window < plans_.size(); ++window) {
      const std::vector<Pane>& panes = plans_[window].panes;
      for (std::size_t pane = 0; pane < panes.size(); ++pane) {
        const auto found = std::ranges::find(frame.screens, panes[pane].screen, &ScreenPicture::screen);
        if (found == frame.screens.end()) continue;
        const PanelTransform& panel_transform =
            panel_transforms_.try_emplace(found->screen, wall_, found->screen).first->second;
        pictures.push_back({window, pane, panel_transform.apply(found->image)});
      }
    }
    windows_.present(std::move(pictures));
  }

  [[nodiscard]] DisplayInput take_input() override { return windows_.take_input(); }

 private:
  const Wall& wall_;
  std::map<std::size_t, PanelTransform> panel_transforms_;  ///< by screen
  std::vector<WindowPlan> plans_;
  WindowThread windows_;
};

std::unique_ptr<Display> make_window_display(const Wall& wall, const DisplayOptions& options) {
  const std::vector<WindowPlan> plans = plan_windows(wall, screens_or_all(wall, options));
  choose_x_display(plans);
  return std::make_unique<WindowDisplay>(wall, plans);
}

void check_window_display(const Wall& wall, const DisplayOptions& /*options*/) {
  const auto elsewhere = [](const WallWindow& window) { return !window.display.empty(); };
  const auto distant = [](const WallNode& node) { return node.host != "localhost" && node.host != "*"; };
  if (std::ranges::any_of(wall.windows, elsewhere) || std::ranges::any_of(wall.nodes, distant)) return;
  const WindowThread no_windows(std::vector<WindowPlan>{});
}

}  // namespace

std::vector<WindowPlan> plan_windows(const Wall& wall, const std::vector<std::size_t>& screens) {
  const WallPicture picture = wall_picture(wall, kMaxDesktopSide);
  const double wall_height = std::max(wall_extent(wall).height, 1e-9);
  std::vector<WindowPlan> plans;
  for (const std::size_t index : screens) {
    const WallScreen& screen = wall.screens.at(index);
    Pane pane{index, screen.viewport, screen.rotate, screen.mirror,
              screen_height(screen) / screen.pixels.height / wall_height};
    const auto window = std::ranges::find(wall.windows, screen.window, &WallWindow::id);
    if (screen.window.empty() || window == wall.windows.end()) {
      const Rect on_wall = picture.screens[index];
      pane.rect = at(0, 0, panel_pixels(screen));
      plans.push_back({.title = screen.id,
                       .window = {},
                       .rect = at(on_wall.x0, on_wall.y0, panel_pixels(screen)),
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

std::optional<std::size_t> pane_at(const WindowPlan& plan, const glm::dvec2& position) {
  for (std::size_t i = 0; i < plan.panes.size(); ++i) {
    const Rect& pane = plan.panes[i].rect;
    if (position.x >= pane.x0 && position.x < pane.x1 && position.y >= pane.y0 && position.y < pane.y1) return i;
  }
  return std::nullopt;
}

glm::dvec2 upright(const Pane& pane, const glm::dvec2& motion) {
  glm::dvec2 turned = motion;
  if (pane.mirror == Mirror::Horizontal) turned.x = -turned.x;
  if (pane.mirror == Mirror::Vertical) turned.y = -turned.y;
  // A clockwise quarter turn takes what goes right in the picture down on the pane.
  for (int degrees = pane.rotate; degrees > 0; degrees -= 90) turned = {turned.y, -turned.x};
  return turned;
}

bool has_desktop() {
  try {
    constexpr std::chrono::seconds kToAnswer{10};  // there is another way to show things
    const WindowThread no_windows({}, kToAnswer);
    return true;
  } catch (const Error& error) {
    log::debug("{}", error.what());
    return false;
  }
}

DisplayKind window_display() {
  return {.name = "window", .interactive = true, .make = make_window_display, .check = check_window_display};
}

}  // namespace hpr
