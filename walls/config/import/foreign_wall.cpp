#include "walls/config/import/foreign_wall.h"

#include <fmt/format.h>

#include <algorithm>
#include <glm/geometric.hpp>

#include "core/error.h"
#include "core/text.h"
#include "walls/config/wall_draft.h"

namespace hpr {
namespace {

std::string line_of(std::string_view text, int line) {
  for (int i = 1; i < line; ++i) {
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos) return {};
    text.remove_prefix(end + 1);
  }
  return printable(text.substr(0, text.find_first_of("\r\n")), 200);
}

}  // namespace

void throw_in_file(std::string_view text, const std::string& name, int line, std::string_view what, std::string hint) {
  if (line < 1) throw Error(ExitCode::BadInput, fmt::format("{}: {}", name, what), std::move(hint));
  throw Error(ExitCode::BadInput, fmt::format("{}:{}: {}", name, line, what), std::move(hint), line_of(text, line));
}

std::string node_of_host(Wall& wall, const std::string& host) {
  const auto found = std::ranges::find(wall.nodes, host, &WallNode::host);
  if (found != wall.nodes.end()) {
    ++found->ranks;
    return found->id;
  }
  wall.nodes.push_back({fmt::format("n{}", wall.nodes.size()), host, 1, {}});
  return wall.nodes.back().id;
}

double grid_width(const ForeignGrid& grid) {
  const int panels = grid.columns * grid.panels.width;
  return (static_cast<double>(panels) * grid.panel.width + (panels - 1.0) * grid.gap_x_pixels) * grid.pitch_m;
}

void add_grid(const ForeignGrid& grid, const std::vector<ForeignTile>& tiles, ImportedWall& into) {
  WallGrid metres;
  metres.columns = grid.columns * grid.panels.width;
  metres.rows = grid.rows * grid.panels.height;
  metres.tile_pixels = grid.panel;
  metres.tile_width_m = grid.panel.width * grid.pitch_m;
  metres.tile_height_m = grid.panel.height * grid.pitch_m;
  metres.column_gaps_m.assign(static_cast<std::size_t>(metres.columns) - 1, grid.gap_x_pixels * grid.pitch_m);
  metres.row_gaps_m.assign(static_cast<std::size_t>(metres.rows) - 1, grid.gap_y_pixels * grid.pitch_m);
  metres.center.x = grid.left_m + 0.5 * grid_width(grid);
  std::vector<WallScreen> screens = expand_grid(metres, grid.surface);
  for (const ForeignTile& tile : tiles) {
    WallWindow window;
    window.id = fmt::format("{}-w{}-{}", grid.surface, tile.row, tile.column);
    window.node = tile.node;
    window.display = tile.display;
    window.fullscreen = tile.fullscreen;
    Rect all{tile.x, tile.y, tile.x, tile.y};
    for (int py = 0; py < grid.panels.height; ++py) {
      for (int px = 0; px < grid.panels.width; ++px) {
        const int column = tile.column * grid.panels.width + px;
        const int row = tile.row * grid.panels.height + py;
        const int place = row * metres.columns + column;
        WallScreen& screen = screens[static_cast<std::size_t>(place)];
        const int x = px * (grid.panel.width + grid.gap_x_pixels);
        const int y = py * (grid.panel.height + grid.gap_y_pixels);
        screen.window = window.id;
        screen.viewport = {x, y, x + grid.panel.width, y + grid.panel.height};
        all.x1 = std::max(all.x1, tile.x + screen.viewport.x1);
        all.y1 = std::max(all.y1, tile.y + screen.viewport.y1);
      }
    }
    if (tile.placed) window.rect = all;
    into.wall.windows.push_back(std::move(window));
  }
  const std::size_t panels = grid.panels.area();
  const std::size_t windows = screens.size() / panels;
  if (tiles.size() < windows) {
    into.remarks.push_back(fmt::format("{} of {} places of the grid are driven by no process: any rank may show them.",
                                       windows - tiles.size(), windows));
  }
  into.wall.screens.insert(into.wall.screens.end(), screens.begin(), screens.end());
}

std::string pitch_remark(const ImportSettings& settings) {
  return fmt::format(
      "The file counts in pixels: metres are pixels times {:g} mm. If panels have another pitch, import again with "
      "--pitch.",
      1e3 * settings.pitch_m);
}

void square_corners(WallScreen& screen) {
  const glm::dvec3 across = screen.lower_right - screen.lower_left;
  const glm::dvec3 up = screen.upper_left - screen.lower_left;
  const double width = glm::dot(across, across);
  if (width <= 0.0) return;
  const glm::dvec3 slant = across * (glm::dot(up, across) / width);
  if (glm::length(slant) < 1e-3 * glm::length(up)) screen.upper_left -= slant;
}

}  // namespace hpr
