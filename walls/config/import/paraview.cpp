#include <fmt/format.h>

#include <cmath>
#include <cstdio>

#include "core/text.h"
#include "walls/config/import/foreign_wall.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

using Element = tinyxml2::XMLElement;

/// A server process of ParaView with the window it opens.
struct Machine {
  const Element* element = nullptr;
  std::string host;     ///< may be empty: then only their ranks distinguish processes
  std::string display;  ///< may be empty
  Rect window;          ///< may be empty
};

/// ":0.1" of "FOO=1 DISPLAY=:0.1"
std::string display_in(const std::string& environment) {
  constexpr std::string_view kKey = "DISPLAY=";
  const std::size_t at = environment.find(kKey);
  if (at == std::string::npos) return {};
  const std::string rest = environment.substr(at + kKey.size());
  return rest.substr(0, rest.find_first_of(" ;\t"));
}

Machine read_machine(const XmlFile& file, const Element& element) {
  Machine machine{&element, XmlFile::text(element, "Name"), display_in(XmlFile::text(element, "Environment")), {}};
  if (machine.host.empty()) machine.host = XmlFile::text(element, "name");
  const std::string geometry = XmlFile::text(element, "Geometry");
  if (geometry.empty()) return machine;
  int width = 0;
  int height = 0;
  int x = 0;
  int y = 0;
  int used = 0;
  const int read = std::sscanf(geometry.c_str(), "%6dx%6d%7d%7d%n", &width, &height, &x, &y, &used);
  const bool whole = read == 4 && static_cast<std::size_t>(used) == geometry.size();
  if (!whole || width < 1 || height < 1 || width > kMaxScreenSide || height > kMaxScreenSide) {
    file.fail(element, fmt::format("Geometry is '{}'", printable(geometry)), "write e.g. Geometry=\"1920x1080+0+0\"");
  }
  machine.window = {x, y, x + width, y + height};
  return machine;
}

/// The element of the process that draws; the file's root where there is none.
const Element& server_process(const Element& root) {
  const Element* chosen = &root;
  for (const Element* const process : XmlFile::children(root, "Process")) {
    if (XmlFile::text(*process, "Type").find("server") == std::string::npos) continue;
    chosen = process;
    if (process->FirstChildElement("Machine") != nullptr) break;
  }
  return *chosen;
}

const Element* option(const Element& process, std::string_view name) {
  for (const Element* const element : XmlFile::children(process, "Option")) {
    if (XmlFile::text(*element, "Name") == name) return element;
  }
  return nullptr;
}

int option_value(const XmlFile& file, const Element& process, std::string_view name, int low, int high) {
  const Element* const element = option(process, name);
  return element != nullptr ? file.integer(*element, "Value", low, high) : 0;
}

/// Machines without a name differ by rank only: each counts as a host of its own, wherever that rank runs.
std::string node_of(Wall& wall, const Machine& machine) {
  if (!machine.host.empty()) return node_of_host(wall, machine.host);
  wall.nodes.push_back({fmt::format("n{}", wall.nodes.size()), "*", 1, {}});
  return wall.nodes.back().id;
}

void import_tiles(const XmlFile& file, const Element& process, const std::vector<Machine>& machines,
                  const ImportSettings& settings, ImportedWall& into) {
  ForeignGrid grid;
  // As pvserver takes them: of two, the one that is not given is 1.
  grid.columns = std::max(1, option_value(file, process, "tile-dimensions-x", 0, kMaxScreens));
  grid.rows = std::max(1, option_value(file, process, "tile-dimensions-y", 0, kMaxScreens));
  if (grid.columns * grid.rows > kMaxScreens) {
    file.fail(process, fmt::format("the wall has {}x{} tiles", grid.columns, grid.rows),
              fmt::format("it may have {}", kMaxScreens));
  }
  grid.panel = settings.pixels;
  const bool has_size = !machines.empty() && !machines.front().window.empty();
  if (has_size) grid.panel = {machines.front().window.width(), machines.front().window.height()};
  if (!has_size) {
    into.remarks.push_back(
        fmt::format("The file does not tell the tiles' pixels: they are {}x{} here, or as --pixels says.",
                    grid.panel.width, grid.panel.height));
  }
  grid.gap_x_pixels = option_value(file, process, "tile-mullion-x", 1 - grid.panel.width, kMaxScreenSide);
  grid.gap_y_pixels = option_value(file, process, "tile-mullion-y", 1 - grid.panel.height, kMaxScreenSide);
  grid.pitch_m = settings.pitch_m;
  into.remarks.push_back(pitch_remark(settings));
  std::vector<ForeignTile> tiles;
  for (std::size_t i = 0; i < machines.size(); ++i) {
    const int index = static_cast<int>(i);
    if (index >= grid.columns * grid.rows) {
      into.remarks.push_back(fmt::format("The last {} machines drive no tile and were left out.", machines.size() - i));
      break;
    }
    const Machine& machine = machines[i];
    const Size size{machine.window.width(), machine.window.height()};
    if (has_size && size != grid.panel) {
      file.fail(*machine.element, "its Geometry has another size than the first machine's", "tiles are of one size");
    }
    tiles.push_back({.column = index % grid.columns,
                     .row = index / grid.columns,
                     .node = node_of(into.wall, machine),
                     .display = machine.display,
                     .x = machine.window.x0,
                     .y = machine.window.y0,
                     .placed = has_size});
  }
  add_grid(grid, tiles, into);
}

WallScreen read_screen(const XmlFile& file, const Machine& machine) {
  const Element& element = *machine.element;
  const auto lower_left = file.point(element, "LowerLeft");
  const auto lower_right = file.point(element, "LowerRight");
  const auto upper_left = file.point(element, "UpperLeft");  // of older files
  const auto upper_right = file.point(element, "UpperRight");
  if (!lower_left || !lower_right || (!upper_left && !upper_right)) {
    file.fail(element, "the machine has no LowerLeft, LowerRight and UpperRight",
              R"(give it corners, or the Process its <Option Name="tile-dimensions-x" Value="..."/>)");
  }
  WallScreen screen;
  screen.surface = "cave";
  screen.lower_left = *lower_left;
  screen.lower_right = *lower_right;
  screen.upper_left = upper_right ? *upper_right - (*lower_right - *lower_left) : *upper_left;
  square_corners(screen);
  return screen;
}

void import_corners(const XmlFile& file, const std::vector<Machine>& machines, const ImportSettings& settings,
                    ImportedWall& into) {
  bool assumed = false;
  for (const Machine& machine : machines) {
    WallScreen screen = read_screen(file, machine);
    screen.id = fmt::format("screen{}", into.wall.screens.size());
    if (machine.window.empty()) {
      assumed = true;
      const double width = settings.pixels.height * screen_width(screen) / screen_height(screen);
      const bool sound = std::isfinite(width) && width >= 1.0 && width <= kMaxScreenSide;
      screen.pixels = {sound ? static_cast<int>(std::lround(width)) : settings.pixels.width, settings.pixels.height};
    } else {
      screen.pixels = {machine.window.width(), machine.window.height()};
    }
    screen.viewport = {0, 0, screen.pixels.width, screen.pixels.height};
    screen.window = fmt::format("w{}", into.wall.windows.size());
    WallWindow window;
    window.id = screen.window;
    window.node = node_of(into.wall, machine);
    window.display = machine.display;
    window.rect = machine.window;
    into.wall.windows.push_back(std::move(window));
    into.wall.screens.push_back(std::move(screen));
  }
  into.wall.viewers.front().has_position = true;  // ParaView's stands where its corners are measured from
  if (assumed) {
    into.remarks.push_back(
        fmt::format("The file does not tell all screens' pixels: those have square ones, {} high, or as --pixels says.",
                    settings.pixels.height));
  }
}

ImportedWall import_paraview(std::string_view text, const std::string& name, const ImportSettings& settings) {
  const XmlFile file(text, name);
  const Element& process = server_process(file.root("pvx"));
  std::vector<Machine> machines;
  for (const Element* const element : XmlFile::children(process, "Machine")) {
    machines.push_back(read_machine(file, *element));
  }
  ImportedWall imported;
  imported.wall.name = "ParaView wall";
  if (process.FirstChildElement("EyeSeparation") != nullptr) {
    imported.remarks.emplace_back("EyeSeparation was left out: both eyes see one picture.");
  }
  if (option(process, "tile-dimensions-x") != nullptr || option(process, "tile-dimensions-y") != nullptr) {
    import_tiles(file, process, machines, settings, imported);
  } else if (!machines.empty()) {
    import_corners(file, machines, settings, imported);
  } else {
    file.fail(process, "it tells of no machine and no tile",
              R"(add what pvserver was told: <Option Name="tile-dimensions-x" Value="3"/>)");
  }
  return imported;
}

}  // namespace

WallImporter paraview_importer() {
  return {"paraview", "pvx", "ParaView's .pvx: CAVE corners, or tiles and mullions", import_paraview};
}

}  // namespace hpr
