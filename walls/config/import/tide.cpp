#include <fmt/format.h>
#include <fmt/ranges.h>

#include <map>
#include <set>

#include "walls/config/import/foreign_wall.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

/// Tide (Blue Brain Project): grids of screens, each of one or several displays in one window, bezels in pixels.
class TideReader {
 public:
  TideReader(std::string_view text, const std::string& name, const ImportSettings& settings)
      : file_(text, name), settings_(settings) {}

  ImportedWall read() {
    const Json& root = file_.object(file_.root(), "");
    imported_.wall.name = "Tide wall";
    const std::vector<Json>& surfaces = file_.array(root, "", "surfaces");
    if (surfaces.empty()) file_.fail("", "it has no \"surfaces\"", "is it Tide's configuration.json?");
    for (const Json& surface : surfaces) read_surface(surface);
    tiles_.resize(grids_.size());
    const std::vector<Json>& processes = file_.array(root, "", "processes");
    for (std::size_t i = 0; i < processes.size(); ++i) read_process(processes[i], fmt::format("/processes/{}", i));
    for (std::size_t i = 0; i < grids_.size(); ++i) add_grid(grids_[i], tiles_[i], imported_);
    write_remarks(root);
    return std::move(imported_);
  }

 private:
  int count(const Json& surface, const std::string& path, const char* key, const char* newer_key) const {
    return file_.integer(surface, path, surface.contains(newer_key) ? newer_key : key, 1, kMaxScreens);
  }

  void read_surface(const Json& surface) {
    const std::string path = fmt::format("/surfaces/{}", grids_.size());
    (void)file_.object(surface, path);
    ForeignGrid grid;
    if (!grids_.empty()) grid.surface = fmt::format("surface{}", grids_.size());
    grid.columns = count(surface, path, "numScreensX", "screenCountX");
    grid.rows = count(surface, path, "numScreensY", "screenCountY");
    grid.panel = {file_.integer(surface, path, "displayWidth", 1, kMaxScreenSide),
                  file_.integer(surface, path, "displayHeight", 1, kMaxScreenSide)};
    grid.panels = {file_.integer(surface, path, "displaysPerScreenX", 1, kMaxScreens, 1),
                   file_.integer(surface, path, "displaysPerScreenY", 1, kMaxScreens, 1)};
    const double panels = 1.0 * grid.columns * grid.rows * grid.panels.width * grid.panels.height;
    panels_ += panels;
    if (panels_ > kMaxScreens) {
      file_.fail(path, fmt::format("up to here the wall has {:g} displays", panels_),
                 fmt::format("it may have {}", kMaxScreens));
    }
    grid.gap_x_pixels = file_.integer(surface, path, "bezelWidth", 1 - grid.panel.width, kMaxScreenSide, 0);
    grid.gap_y_pixels = file_.integer(surface, path, "bezelHeight", 1 - grid.panel.height, kMaxScreenSide, 0);
    grid.pitch_m = 1.0;
    const double width_pixels = grid_width(grid);
    const std::vector<Json>& size_m = file_.array(surface, path, "dimensions");
    if (size_m.size() == 2 && size_m[0].is_number() && size_m[0].get<double>() > 0.0) {
      grid.pitch_m = size_m[0].get<double>() / width_pixels;
    } else {
      grid.pitch_m = settings_.pitch_m;
      by_pitch_ = true;
    }
    grid.left_m = right_m_;
    right_m_ += grid_width(grid) + 1.0;
    grids_.push_back(grid);
  }

  void read_process(const Json& process, const std::string& path) {
    (void)file_.object(process, path);
    const std::string node = node_of_host(imported_.wall, file_.text(process, path, "host", "localhost"));
    const std::vector<Json>& screens = file_.array(process, path, "screens");
    for (std::size_t i = 0; i < screens.size(); ++i) {
      read_screen(screens[i], fmt::format("{}/screens/{}", path, i), node);
    }
  }

  void read_screen(const Json& screen, const std::string& path, const std::string& node) {
    (void)file_.object(screen, path);
    const int surface = file_.integer(screen, path, "surface", 0, static_cast<int>(grids_.size()) - 1, 0);
    const ForeignGrid& grid = grids_[static_cast<std::size_t>(surface)];
    if (file_.text(screen, path, "stereo", "mono") == "right") {
      ++right_eyes_;
      return;
    }
    ForeignTile tile{.node = node, .display = file_.text(screen, path, "display", "")};
    tile.fullscreen = file_.boolean(screen, path, "fullscreen");
    tile.column = file_.integer(screen, path, "i", 0, grid.columns - 1, 0);
    tile.row = file_.integer(screen, path, "j", 0, grid.rows - 1, 0);
    tile.x = file_.integer(screen, path, "x", -kMaxScreenSide, kMaxScreenSide, 0);
    tile.y = file_.integer(screen, path, "y", -kMaxScreenSide, kMaxScreenSide, 0);
    const auto [other, fresh] = positions_.emplace(std::array{surface, tile.column, tile.row}, path);
    if (!fresh) {
      file_.fail(path, fmt::format("screen i {}, j {} is driven twice", tile.column, tile.row),
                 fmt::format("the other one is {}", other->second));
    }
    tiles_[static_cast<std::size_t>(surface)].push_back(std::move(tile));
  }

  void write_remarks(const Json& root) {
    if (by_pitch_) imported_.remarks.push_back(pitch_remark(settings_));
    if (grids_.size() > 1) {
      imported_.remarks.emplace_back(
          "Tide's surfaces have no place in the room: they stand side by side, a metre apart.");
    }
    if (right_eyes_ > 0) {
      imported_.remarks.push_back(fmt::format("{} screens of the right eye were left out.", right_eyes_));
    }
    std::set<std::string> unused;
    for (const auto& [key, value] : root.members()) {
      if (key != "surfaces" && key != "processes") unused.insert(key);
    }
    if (unused.empty()) return;
    imported_.remarks.push_back(fmt::format("Of no use to a wall and left out: {}.", fmt::join(unused, ", ")));
  }

  JsonFile file_;
  ImportSettings settings_;
  ImportedWall imported_;
  std::vector<ForeignGrid> grids_;
  double panels_ = 0.0;                          ///< of all surfaces
  std::vector<std::vector<ForeignTile>> tiles_;  ///< of grids_
  std::map<std::array<int, 3>, std::string> positions_;
  double right_m_ = 0.0;  ///< where the next surface begins
  bool by_pitch_ = false;
  int right_eyes_ = 0;
};

ImportedWall import_tide(std::string_view text, const std::string& name, const ImportSettings& settings) {
  return TideReader(text, name, settings).read();
}

}  // namespace

WallImporter tide_importer() {
  return {"tide", "tide", "Tide's configuration.json", import_tide};
}

}  // namespace hpr
