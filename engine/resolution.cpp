#include "engine/resolution.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace hpr {
namespace {

int scaled(int side, double scale) {
  return std::max(static_cast<int>(std::lround(side * scale)), 1);
}

}  // namespace

std::vector<View> at_resolution(std::span<const View> screens, double scale) {
  std::vector<View> made(screens.begin(), screens.end());
  for (View& view : made) {
    HPR_CHECK(view.size() == view.screen);
    view.screen = {scaled(view.screen.width, scale), scaled(view.screen.height, scale)};
    view.block = {0, 0, view.screen.width, view.screen.height};
  }
  return made;
}

}  // namespace hpr
