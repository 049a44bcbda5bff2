#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <optional>

#include "scene/view.h"

namespace hpr {
namespace {

/// Of a pixel: how far a screen may lie off the grid of the first one.
constexpr double kMaxOffset = 1.0 / 16.0;
/// What is equal but for rounding differs by no more than this share.
constexpr double kRounding = 1e-9;

/// Whether one eye looks at both, in one direction.
bool share_eye(const View& a, const View& b) {
  const auto is_close = [](double one, double other) { return std::abs(one - other) <= kRounding * std::abs(one); };
  if (a.points || b.points || a.orthographic != b.orthographic) return false;
  for (int axis = 0; axis < 3; ++axis) {
    if (glm::distance(a.axes[axis], b.axes[axis]) > kRounding) return false;
  }
  return glm::distance(a.eye, b.eye) <= kRounding * (a.near_distance + glm::length(a.eye)) &&
         is_close(a.near_distance, b.near_distance) && is_close(a.far_distance, b.far_distance);
}

std::optional<int> whole(double pixels) {
  constexpr double kMaxPixels = 1e9;
  const double rounded = std::round(pixels);
  if (!(std::abs(pixels - rounded) <= kMaxOffset) || std::abs(rounded) > kMaxPixels) return std::nullopt;
  return static_cast<int>(rounded);
}

/// Where a screen lies on the grid of pixels of another one, of which the first pixel is (0, 0).
std::optional<Rect> rect_on_grid(const View& grid, const View& view) {
  if (!share_eye(grid, view)) return std::nullopt;
  const double per_x = grid.screen.width / (grid.right - grid.left);
  const double per_y = grid.screen.height / (grid.top - grid.bottom);
  const std::optional<int> x0 = whole(per_x * (view.left - grid.left));
  const std::optional<int> x1 = whole(per_x * (view.right - grid.left));
  const std::optional<int> y0 = whole(per_y * (grid.top - view.top));
  const std::optional<int> y1 = whole(per_y * (grid.top - view.bottom));
  if (!x0 || !x1 || !y0 || !y1) return std::nullopt;
  const Rect rect{*x0, *y0, *x1, *y1};
  if (Size{rect.width(), rect.height()} != view.screen) return std::nullopt;
  return rect;
}

/// Along an edge, or by more.
bool touch(const Rect& a, const Rect& b) {
  const Rect common = intersection(a, b);
  return common.width() >= 0 && common.height() >= 0 && common.width() + common.height() > 0;
}

struct Part {
  std::size_t screen = 0;
  Rect rect;
};

/// The screens that hang together with `first`, which is one of them, out of those that are left.
std::vector<Part> group_about(std::span<const View> screens, std::size_t first, const std::vector<bool>& is_placed) {
  std::vector<Part> apart;
  for (std::size_t i = first + 1; i < screens.size(); ++i) {
    if (is_placed[i]) continue;
    if (const auto rect = rect_on_grid(screens[first], screens[i])) apart.push_back({i, *rect});
  }
  std::vector<Part> group{{first, {0, 0, screens[first].screen.width, screens[first].screen.height}}};
  for (std::size_t i = 0; i < group.size(); ++i) {
    const Rect from = group[i].rect;
    std::erase_if(apart, [&](const Part& part) {
      const bool joins = touch(from, part.rect);
      if (joins) group.push_back(part);
      return joins;
    });
  }
  return group;
}

/// The screen that a group spans; its edges are those of the outermost parts.
View spanned_screen(std::span<const View> screens, const std::vector<Part>& group) {
  const auto outermost = [&](int Rect::*edge, bool is_last) {
    const auto value = [&](const Part& part) { return part.rect.*edge; };
    return is_last ? *std::ranges::max_element(group, {}, value) : *std::ranges::min_element(group, {}, value);
  };
  const Part left = outermost(&Rect::x0, false);
  const Part right = outermost(&Rect::x1, true);
  const Part top = outermost(&Rect::y0, false);
  const Part bottom = outermost(&Rect::y1, true);
  View view = screens[group.front().screen];
  view.left = screens[left.screen].left;
  view.right = screens[right.screen].right;
  view.top = screens[top.screen].top;
  view.bottom = screens[bottom.screen].bottom;
  view.screen = {right.rect.x1 - left.rect.x0, bottom.rect.y1 - top.rect.y0};
  view.block = {left.rect.x0, top.rect.y0, right.rect.x1, bottom.rect.y1};
  return view;
}

}  // namespace

std::vector<View> join_screens(std::span<const View> screens) {
  std::vector<View> joined(screens.begin(), screens.end());
  std::vector<bool> is_placed(screens.size(), false);
  for (std::size_t i = 0; i < screens.size(); ++i) {
    if (is_placed[i]) continue;
    const std::vector<Part> group = group_about(screens, i, is_placed);
    for (const Part& part : group) is_placed[part.screen] = true;
    if (group.size() == 1) continue;
    const View spanned = spanned_screen(screens, group);
    for (const Part& part : group) {
      View& view = joined[part.screen];
      const std::uint32_t screen_number = view.screen_number;
      view = spanned;
      view.block = {part.rect.x0 - spanned.block.x0, part.rect.y0 - spanned.block.y0, part.rect.x1 - spanned.block.x0,
                    part.rect.y1 - spanned.block.y0};
      view.joined_part = {screen_number, view.block};
    }
  }
  return joined;
}

}  // namespace hpr
