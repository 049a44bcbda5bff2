#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "walls/config/wall.h"

namespace hpr {

/// A screen as another one of its plane sees it: metres along that one's right and up from its lower left corner.
struct PlanarBox {
  std::array<double, 2> low{};
  std::array<double, 2> high{};
  bool swapped = false;              ///< its right lies along the other's up, or against it
  std::array<int, 2> along{{1, 1}};  ///< directions of its right and up: 1 or -1
};

/// The box of `other` as `screen` sees it; none for screens of other planes, eyes or viewers, and for those turned by
/// other than right angles.
[[nodiscard]] std::optional<PlanarBox> seen_from(const WallScreen& other, const WallScreen& screen);

/// Metres by which `box` and the screen it is seen from share an axis, in the narrower direction; negative: the gap.
[[nodiscard]] double overlap_meters(const PlanarBox& box, const WallScreen& screen);

/// Pairs of screens, by index, the lower first, that are no farther apart than `reach` of their sizes: a quick choice
/// of those worth a closer look.
[[nodiscard]] std::vector<std::pair<std::size_t, std::size_t>> close_pairs(const std::vector<WallScreen>& screens,
                                                                           double reach);

/// The sides of a screen, as its viewer sees them.
enum class Side { Left, Right, Up, Down };

/// Per side the screen that goes on there: whose facing edge is nearest, up to a third of a screen away; also around
/// the corners of a curved wall. Screens for the other eye are none.
[[nodiscard]] std::array<std::optional<std::size_t>, 4> adjacent_screens(const Wall& wall, std::size_t screen);

}  // namespace hpr
