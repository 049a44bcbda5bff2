#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "walls/config/toml_document.h"
#include "walls/config/toml_reader.h"
#include "walls/config/wall.h"

/// What the files that read a wall share among themselves.
namespace hpr {

struct DraftNode {
  WallNode node;
  TextPosition position;
};

struct DraftWindow {
  WallWindow window;
  TextPosition position;       ///< of the table
  TextPosition node_position;  ///< of the node's name
  TextPosition gpu_position;
  TextPosition rank_position;
};

struct DraftScreen {
  WallScreen screen;  ///< node, rank and viewport are settled by link_wall
  TextPosition position;
  TextPosition window_position;
  TextPosition warp_position;
  bool has_corners = false;  ///< and they are sound
};

struct DraftSurface {
  std::string id;
  std::string viewer = {};  ///< id; empty: the first
  TextPosition position = {};
  TextPosition viewer_position = {};
};

struct DraftViewer {
  WallViewer viewer;
  TextPosition position;
  bool placed = false;  ///< has a position_m, sound or not
};

struct DraftMonitor {
  WallMonitor monitor;
  TextPosition position;
  TextPosition surface_position;
};

struct WallDraft {
  std::vector<DraftNode> nodes;
  std::vector<DraftWindow> windows;
  std::vector<DraftSurface> surfaces;
  std::vector<DraftScreen> screens;
  std::vector<DraftViewer> viewers;
  std::vector<DraftMonitor> monitors;
  StereoMode stereo = StereoMode::None;
  TextPosition stereo_position;
};

/// Metres a screen's sides have at least.
inline constexpr double kMinSide_m = 1e-6;

/// A grid as its table has it.
struct DraftGrid {
  std::optional<int> columns = {};
  std::optional<int> rows = {};
  std::optional<Size> tile_pixels = {};
  std::optional<std::vector<double>> tile_size_m = {};  ///< width, height
  std::optional<std::vector<double>> gap_m = {};        ///< x, y
  glm::dvec3 center{0.0};
  WallScreen tile = {};  ///< how all of them are mounted and lit
  std::optional<std::vector<std::string>> windows = {};
  std::optional<std::vector<double>> column_gaps_m = {};
  std::optional<std::vector<double>> row_gaps_m = {};
  std::optional<double> radius_m = {};
  std::optional<double> angle_degrees = {};
  int max_screens = 0;  ///< that the wall may have besides those there are

  [[nodiscard]] std::int64_t screens() const { return std::int64_t{columns.value_or(1)} * rows.value_or(1); }
  [[nodiscard]] bool is_countable() const { return columns && rows && screens() <= max_screens; }
  [[nodiscard]] bool is_sized() const {
    return tile_size_m && (*tile_size_m)[0] >= kMinSide_m && (*tile_size_m)[1] >= kMinSide_m;
  }
};

/// Reads all keys of a wall file (wall_keys.h): into `draft` the tables whose places matter later, all else into
/// `wall`. Grids are expanded, in order. Files are looked for in `folder`.
void read_document(TableReader& document, const std::filesystem::path& folder, WallDraft& draft, Wall& wall);

/// Reads the `warp` of a screen, whose pixels are known, and its files.
void read_warp(TableReader& screen_reader, const std::filesystem::path& folder, WallScreen& screen);

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
  /// Columns stand as chords on an arc around a vertical axis in front of the centre, gaps are measured along the arc;
  /// 0: all in one plane.
  double radius_m = 0.0;
};
/// The radius at which the columns and their gaps take `angle` radians of the arc; none when no arc does.
[[nodiscard]] std::optional<double> radius_of_arc(const WallGrid& grid, double angle);
/// The columns fit on a circle of this radius.
[[nodiscard]] bool fits_arc(const WallGrid& grid, double radius);
[[nodiscard]] std::vector<WallScreen> expand_grid(const WallGrid& grid, const std::string& surface);

/// Checks what spans tables (references, doubles, overlaps) and settles who owns which screen. False: there is too much
/// of something to check more.
[[nodiscard]] bool link_wall(WallDraft& draft, Findings& findings);

/// Checks what viewers, stereo and monitors refer to, and settles which viewer sees which screen.
void link_viewers(WallDraft& draft, Findings& findings);

/// Checks what linked viewers see of the points of position maps.
void check_position_maps(const WallDraft& draft, Findings& findings);

/// Warns about viewers who stand behind what they look at.
void warn_about_viewers(const WallDraft& draft, Findings& findings);

/// Warns about what is sound and looks wrong: pixels of other sizes beside each other, edges faded on one side only.
void warn_about_neighbors(const WallDraft& draft, Findings& findings);

}  // namespace hpr
