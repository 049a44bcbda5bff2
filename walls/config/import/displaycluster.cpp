#include <fmt/format.h>

#include <map>

#include "walls/config/import/foreign_wall.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

/// DisplayCluster (Johnson, Abram, Westing, Navratil, Gaither: "DisplayCluster: An Interactive Visualization
/// Environment for Tiled Displays", 2012): equal tiles, mullions in pixels, one process per group of tiles.
ImportedWall import_displaycluster(std::string_view text, const std::string& name, const ImportSettings& settings) {
  const XmlFile file(text, name);
  const tinyxml2::XMLElement& root = file.root("configuration");
  const tinyxml2::XMLElement& dimensions = file.child(root, "dimensions");
  ForeignGrid grid;
  grid.columns = file.integer(dimensions, "numTilesWidth", 1, kMaxScreens);
  grid.rows = file.integer(dimensions, "numTilesHeight", 1, kMaxScreens);
  grid.panel = {file.integer(dimensions, "screenWidth", 1, kMaxScreenSide),
                file.integer(dimensions, "screenHeight", 1, kMaxScreenSide)};
  grid.gap_x_pixels = file.integer(dimensions, "mullionWidth", 1 - grid.panel.width, kMaxScreenSide, 0);
  grid.gap_y_pixels = file.integer(dimensions, "mullionHeight", 1 - grid.panel.height, kMaxScreenSide, 0);
  grid.pitch_m = settings.pitch_m;
  if (grid.columns * grid.rows > kMaxScreens) {
    file.fail(dimensions, fmt::format("the wall has {}x{} tiles", grid.columns, grid.rows),
              fmt::format("it may have {}", kMaxScreens));
  }
  const bool fullscreen = file.integer(dimensions, "fullscreen", 0, 1, 0) == 1;

  ImportedWall imported;
  imported.wall.name = "DisplayCluster wall";
  imported.remarks.push_back(pitch_remark(settings));
  std::map<std::pair<int, int>, int> lines;
  std::vector<ForeignTile> tiles;
  for (const tinyxml2::XMLElement* const process : XmlFile::children(root, "process")) {
    const std::string host = XmlFile::text(*process, "host");
    const std::string node = node_of_host(imported.wall, host.empty() ? "localhost" : host);
    for (const tinyxml2::XMLElement* const screen : XmlFile::children(*process, "screen")) {
      ForeignTile tile{.node = node, .display = XmlFile::text(*process, "display"), .fullscreen = fullscreen};
      if (const std::string own = XmlFile::text(*screen, "display"); !own.empty()) tile.display = own;
      tile.column = file.integer(*screen, "i", 0, grid.columns - 1);
      tile.row = file.integer(*screen, "j", 0, grid.rows - 1);
      tile.x = file.integer(*screen, "x", -kMaxScreenSide, kMaxScreenSide, 0);
      tile.y = file.integer(*screen, "y", -kMaxScreenSide, kMaxScreenSide, 0);
      const auto [other, fresh] = lines.emplace(std::pair(tile.column, tile.row), screen->GetLineNum());
      if (!fresh) {
        file.fail(*screen, fmt::format("tile i {}, j {} is driven twice", tile.column, tile.row),
                  fmt::format("the other screen is in line {}", other->second));
      }
      tiles.push_back(std::move(tile));
    }
  }
  add_grid(grid, tiles, imported);
  return imported;
}

}  // namespace

WallImporter displaycluster_importer() {
  return {"displaycluster", "displaycluster", "DisplayCluster's configuration.xml", import_displaycluster};
}

}  // namespace hpr
