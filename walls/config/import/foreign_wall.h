#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "walls/config/import/importer.h"

/// What importers share.
namespace hpr {

/// Throws Error (BadInput): "name:line: what", with that line of the text. Line 0: none is known.
[[noreturn]] void throw_in_file(std::string_view text, const std::string& name, int line, std::string_view what,
                                std::string hint);

/// The id of the wall's node of this host; made when there is none. One more rank runs there.
[[nodiscard]] std::string node_of_host(Wall& wall, const std::string& host);

/// A window of another system: a place in a grid of equal ones.
struct ForeignTile {
  int column = 0;
  int row = 0;          ///< from the top
  std::string node;     ///< id
  std::string display;  ///< X display; empty: any
  int x = 0;            ///< on it, pixels
  int y = 0;
  bool fullscreen = false;
  bool placed = true;  ///< x and y are told
};

/// A grid measured in pixels.
struct ForeignGrid {
  std::string surface = "wall";
  int columns = 1;  ///< of windows
  int rows = 1;
  Size panel;            ///< pixels of one panel
  Size panels{1, 1};     ///< panels a window spans
  int gap_x_pixels = 0;  ///< between panels; negative: they overlap
  int gap_y_pixels = 0;
  double pitch_m = 0.0;
  double left_m = 0.0;  ///< of the grid's left edge
};

/// Metres.
[[nodiscard]] double grid_width(const ForeignGrid& grid);

/// Adds windows and screens, gaps in metres by the pitch. A place named by no tile gets a screen without a window and a
/// remark. Tiles lie inside the grid, no two at one place.
void add_grid(const ForeignGrid& grid, const std::vector<ForeignTile>& tiles, ImportedWall& into);

/// Says that metres are pixels times the pitch.
[[nodiscard]] std::string pitch_remark(const ImportSettings& settings);

/// Moves the upper left corner by up to a thousandth of the height, so that corners written with few digits are square.
void square_corners(WallScreen& screen);

}  // namespace hpr
