#pragma once

#include <string>
#include <vector>

#include "walls/findings.h"
#include "walls/toml_reader.h"
#include "walls/wall.h"

/// What the files that read a wall share among themselves.
namespace hpr {

struct DraftNode {
  WallNode node;
  TextPlace place;
};

struct DraftWindow {
  WallWindow window;
  TextPlace place;       ///< of the table
  TextPlace node_place;  ///< of the node's name
  TextPlace gpu_place;
  TextPlace rank_place;
};

struct DraftScreen {
  WallScreen screen;  ///< node, rank and viewport are settled by link_wall
  std::string eye;    ///< empty: both
  TextPlace place;
  TextPlace window_place;
  bool has_corners = false;  ///< and they are sound
};

struct WallDraft {
  std::vector<DraftNode> nodes;
  std::vector<DraftWindow> windows;
  std::vector<DraftScreen> screens;
};

/// Reads `surfaces`: grids are expanded, in order.
void read_surfaces(TableReader& document, WallDraft& draft, Findings& findings);

/// The screens of a grid with their corners; pure, so that the shorthand uses it as well.
struct WallGrid {
  int columns = 1;
  int rows = 1;
  Size tile_pixels;
  double tile_width_m = 0.0;
  double tile_height_m = 0.0;
  std::vector<double> column_gaps_m;  ///< columns - 1, lit edge to lit edge; negative: overlap
  std::vector<double> row_gaps_m;     ///< rows - 1, from the top
  glm::dvec3 center{0.0};
};
[[nodiscard]] std::vector<WallScreen> expand_grid(const WallGrid& grid, const std::string& surface);

/// Checks what spans tables (references, doubles, overlaps) and settles who owns which screen.
void link_wall(WallDraft& draft, Findings& findings);

/// Fills in a wall whose screens are sound: the default viewer and the hash.
void finish_wall(Wall& wall);

}  // namespace hpr
