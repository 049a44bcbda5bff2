#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/vec2.hpp>
#include <numbers>
#include <numeric>

#include "walls/config/wall_draft.h"

namespace hpr {
namespace {

constexpr double kFullTurn = 2.0 * std::numbers::pi;

/// Radians a column takes of the arc.
double column_angle(const WallGrid& grid, double radius) {
  return 2.0 * std::asin(std::min(0.5 * grid.tile_width_m / radius, 1.0));
}

double gaps_of(const WallGrid& grid) {
  return std::accumulate(grid.column_gaps_m.begin(), grid.column_gaps_m.end(), 0.0);
}

double turned_by(const WallGrid& grid, double radius) {
  return grid.columns * column_angle(grid, radius) + gaps_of(grid) / radius;
}

/// The two lower ends of a column of tiles, from above: x, z in metres.
struct ColumnEnds {
  glm::dvec2 left{0.0};
  glm::dvec2 right{0.0};
};

std::vector<ColumnEnds> straight_columns(const WallGrid& grid) {
  std::vector<ColumnEnds> columns;
  const double width =
      std::accumulate(grid.column_gaps_m.begin(), grid.column_gaps_m.end(), grid.columns * grid.tile_width_m);
  double left = grid.center.x - 0.5 * width;
  for (int column = 0; column < grid.columns; ++column) {
    columns.push_back({{left, grid.center.z}, {left + grid.tile_width_m, grid.center.z}});
    if (column + 1 < grid.columns) left += grid.tile_width_m + grid.column_gaps_m[static_cast<std::size_t>(column)];
  }
  return columns;
}

std::vector<ColumnEnds> curved_columns(const WallGrid& grid, double radius) {
  const auto on_arc = [&](double angle) {
    // z by the half angle: 1 - cos loses the digits of a wall that is hardly curved.
    const double half = std::sin(0.5 * angle);
    return glm::dvec2(grid.center.x + radius * std::sin(angle), grid.center.z + 2.0 * radius * half * half);
  };
  std::vector<ColumnEnds> columns;
  const double step = column_angle(grid, radius);
  double angle = -0.5 * turned_by(grid, radius);
  for (int column = 0; column < grid.columns; ++column) {
    columns.push_back({on_arc(angle), on_arc(angle + step)});
    angle += step;
    if (column + 1 < grid.columns) angle += grid.column_gaps_m[static_cast<std::size_t>(column)] / radius;
  }
  return columns;
}

}  // namespace

std::optional<double> radius_of_arc(const WallGrid& grid, double angle) {
  // The arc's angle falls with the radius, so halving finds it; the narrowest arc has a tile across its circle.
  double low = 0.5 * grid.tile_width_m;
  if (turned_by(grid, low) < angle) return std::nullopt;
  double high = low;
  constexpr double kMaxRadius = 1e9;
  while (turned_by(grid, high) > angle) {
    high *= 2.0;
    if (high > kMaxRadius) return std::nullopt;
  }
  constexpr int kHalvings = 200;
  for (int i = 0; i < kHalvings; ++i) {
    const double radius = 0.5 * (low + high);
    (turned_by(grid, radius) > angle ? low : high) = radius;
  }
  return 0.5 * (low + high);
}

bool fits_arc(const WallGrid& grid, double radius) {
  return radius >= 0.5 * grid.tile_width_m && turned_by(grid, radius) <= kFullTurn;
}

std::vector<WallScreen> expand_grid(const WallGrid& grid, const std::string& surface) {
  const std::vector<ColumnEnds> columns =
      grid.radius_m > 0.0 ? curved_columns(grid, grid.radius_m) : straight_columns(grid);
  const double height = std::accumulate(grid.row_gaps_m.begin(), grid.row_gaps_m.end(), grid.rows * grid.tile_height_m);
  std::vector<WallScreen> screens;
  double top = grid.center.y + 0.5 * height;
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      const auto& [left, right] = columns[static_cast<std::size_t>(column)];
      WallScreen screen;
      screen.id = fmt::format("{}-r{}c{}", surface, row, column);
      screen.surface = surface;
      screen.pixels = grid.tile_pixels;
      screen.lower_left = {left.x, top - grid.tile_height_m, left.y};
      screen.lower_right = {right.x, top - grid.tile_height_m, right.y};
      screen.upper_left = {left.x, top, left.y};
      screen.viewport = {0, 0, grid.tile_pixels.width, grid.tile_pixels.height};
      screens.push_back(std::move(screen));
    }
    if (row + 1 < grid.rows) top -= grid.tile_height_m + grid.row_gaps_m[static_cast<std::size_t>(row)];
  }
  return screens;
}

}  // namespace hpr
