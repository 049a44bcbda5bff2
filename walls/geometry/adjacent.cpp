#include "walls/geometry/adjacent.h"

#include <algorithm>
#include <glm/geometric.hpp>

#include "walls/geometry/geometry.h"
#include "walls/geometry/stereo.h"

namespace hpr {
namespace {

/// The middle of an edge, in wall space.
glm::dvec3 middle_of(const WallScreen& screen, Side side) {
  const glm::dvec3 right = screen.lower_right - screen.lower_left;
  const glm::dvec3 up = screen.upper_left - screen.lower_left;
  const glm::dvec3 center = screen_center(screen);
  switch (side) {
    case Side::Left:
      return center - 0.5 * right;
    case Side::Right:
      return center + 0.5 * right;
    case Side::Up:
      return center + 0.5 * up;
    case Side::Down:
      break;
  }
  return center - 0.5 * up;
}

Side opposite(Side side) {
  constexpr std::array kOpposite{Side::Right, Side::Left, Side::Down, Side::Up};
  return kOpposite.at(static_cast<std::size_t>(side));
}

}  // namespace

std::array<std::optional<std::size_t>, 4> adjacent_screens(const Wall& wall, std::size_t screen) {
  constexpr double kReach = 1.0 / 3.0;
  const WallScreen& from = wall.screens.at(screen);
  const double reach = kReach * std::min(screen_width(from), screen_height(from));
  std::array<std::optional<std::size_t>, 4> found;
  for (const Side side : {Side::Left, Side::Right, Side::Up, Side::Down}) {
    double nearest = reach;
    for (std::size_t i = 0; i < wall.screens.size(); ++i) {
      if (i == screen || for_other_eyes(from, wall.screens[i])) continue;
      const double distance = glm::distance(middle_of(from, side), middle_of(wall.screens[i], opposite(side)));
      if (distance >= nearest) continue;
      nearest = distance;
      found.at(static_cast<std::size_t>(side)) = i;
    }
  }
  return found;
}

}  // namespace hpr
