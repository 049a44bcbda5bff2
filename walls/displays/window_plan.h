#pragma once

#include <cstddef>
#include <glm/vec2.hpp>
#include <optional>
#include <string>
#include <vector>

#include "walls/config/wall.h"

namespace hpr {

/// A screen in a window.
struct Pane {
  std::size_t screen = 0;        ///< index into Wall::screens
  Rect rect;                     ///< in the window's pixels
  int rotate = 0;                ///< degrees by which the upright picture is turned clockwise
  Mirror mirror = Mirror::None;  ///< after turning
  double wall_heights_per_pixel = 0.0;
};

/// One window on a desktop.
struct WindowPlan {
  std::string title;
  std::string window;  ///< id of the wall file's window; empty: of a screen that has none
  Rect rect;           ///< on the desktop; never empty
  bool fullscreen = false;
  bool decorated = false;  ///< where the wall file does not place it: people move such windows about
  std::string monitor;     ///< by name; empty: the one most of `rect` is on
  std::string display;     ///< X display; empty: any
  std::vector<Pane> panes;
};

/// The windows that show these screens. Screens without a window in the wall file have one each, placed as they hang on
/// the wall.
[[nodiscard]] std::vector<WindowPlan> plan_windows(const Wall& wall, const std::vector<std::size_t>& screens);

/// Index of the pane at this place of the window, in its pixels.
[[nodiscard]] std::optional<std::size_t> pane_at(const WindowPlan& plan, const glm::dvec2& position);

/// A motion of (right, down) pixels on the pane as it goes in the upright picture.
[[nodiscard]] glm::dvec2 upright(const Pane& pane, const glm::dvec2& motion);

}  // namespace hpr
