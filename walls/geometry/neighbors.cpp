#include "walls/geometry/neighbors.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "walls/geometry/geometry.h"

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

std::optional<PlanarBox> seen_from(const WallScreen& other, const WallScreen& screen) {
  constexpr double kParallel = 1.0 - 1e-6;
  if (screen.eye != other.eye || screen.viewer != other.viewer) return std::nullopt;
  const glm::dmat3 axes = screen_axes(screen);
  const glm::dmat3 theirs = screen_axes(other);
  const double size = screen_width(screen) + screen_width(other);
  if (glm::dot(axes[2], theirs[2]) < kParallel) return std::nullopt;
  if (std::abs(glm::dot(axes[2], other.lower_left - screen.lower_left)) > 1e-6 * size) return std::nullopt;
  const double cosine = glm::dot(axes[0], theirs[0]);
  const double sine = glm::dot(axes[1], theirs[0]);
  PlanarBox box;
  box.swapped = std::abs(sine) > kParallel;
  if (!box.swapped && std::abs(cosine) < kParallel) return std::nullopt;
  box.along = {(box.swapped ? sine : cosine) > 0.0 ? 1 : -1,
               glm::dot(box.swapped ? axes[0] : axes[1], theirs[1]) > 0.0 ? 1 : -1};
  const glm::dvec3 a = other.lower_left - screen.lower_left;
  const glm::dvec3 b = other.lower_right + (other.upper_left - other.lower_left) - screen.lower_left;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const glm::dvec3& direction = axes[static_cast<int>(axis)];
    const auto [low, high] = std::minmax({glm::dot(a, direction), glm::dot(b, direction)});
    box.low[axis] = low;
    box.high[axis] = high;
  }
  return box;
}

double overlap_meters(const PlanarBox& box, const WallScreen& screen) {
  const auto along = [&](std::size_t axis, double size) {
    return std::min(box.high[axis], size) - std::max(box.low[axis], 0.0);
  };
  return std::min(along(0, screen_width(screen)), along(1, screen_height(screen)));
}

std::vector<std::pair<std::size_t, std::size_t>> close_pairs(const std::vector<WallScreen>& screens, double reach) {
  std::vector<glm::dvec3> centers;
  std::vector<double> radii;
  for (const WallScreen& screen : screens) {
    centers.push_back(screen_center(screen));
    radii.push_back((0.5 + reach) * glm::distance(screen.lower_right, screen.upper_left));
  }
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t i = 0; i < screens.size(); ++i) {
    for (std::size_t j = i + 1; j < screens.size(); ++j) {
      const glm::dvec3 apart = centers[j] - centers[i];
      const double near_enough = radii[i] + radii[j];
      if (glm::dot(apart, apart) <= near_enough * near_enough) pairs.emplace_back(i, j);
    }
  }
  return pairs;
}

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
