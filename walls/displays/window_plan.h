#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "walls/wall.h"

namespace hpr {

/// A screen in a window.
struct Pane {
  std::size_t screen = 0;  ///< index into Wall::screens
  Rect place;              ///< in the window's pixels
  int rotate = 0;          ///< degrees by which the upright picture is turned clockwise
  double wall_heights_per_pixel = 0.0;
};

/// One window on a desktop.
struct WindowPlan {
  std::string title;
  Rect rect;  ///< on the desktop; never empty
  bool fullscreen = false;
  bool decorated = false;  ///< where the wall file does not place it: people move such windows about
  std::string monitor;     ///< by name; empty: the one most of `rect` is on
  std::string display;     ///< X display; empty: any
  std::vector<Pane> panes;
};

/// The windows that show these screens. Screens without a window in the wall file have one each, placed as they hang on
/// the wall.
[[nodiscard]] std::vector<WindowPlan> plan_windows(const Wall& wall, const std::vector<std::size_t>& screens);

}  // namespace hpr
