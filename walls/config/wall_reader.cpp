#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

#include "walls/config/wall_draft.h"
#include "walls/config/wall_file.h"
#include "walls/config/wall_keys.h"

/// Reads a wall file's tables into a draft, with the table of keys, and checks what each table has to fulfil by itself.
namespace hpr {
namespace {

/// The largest cosine of the angle between a screen's sides. A picture on skewed corners would need a warp; this much
/// is measuring noise.
constexpr double kMaxCosine = 1e-6;

void read_nodes(TableReader& document, const std::filesystem::path& folder, WallDraft& draft) {
  for (const TomlValue* const table : document.tables("nodes")) {
    TableReader reader(*table, std::string(node_keys().name), document.findings());
    DraftNode draft_node{{}, table->position};
    draft_node.node.host = "localhost";
    read_keys(node_keys(), reader, folder, draft_node.node);
    draft.nodes.push_back(std::move(draft_node));
  }
}

void read_windows(TableReader& document, const std::filesystem::path& folder, WallDraft& draft) {
  for (const TomlValue* const table : document.tables("windows")) {
    TableReader reader(*table, std::string(window_keys().name), document.findings());
    DraftWindow draft_window{
        {}, table->position, reader.position("node"), reader.position("gpu"), reader.position("rank")};
    read_keys(window_keys(), reader, folder, draft_window.window);
    draft.windows.push_back(std::move(draft_window));
  }
}

/// The gaps between columns or rows: all `common`, unless `listed` under `key`. Empty when one overlaps a whole tile.
std::vector<double> check_gaps(TableReader& reader, std::string_view key, std::optional<std::vector<double>> listed,
                               int count, double common, double tile) {
  std::vector<double> gaps = listed.value_or(std::vector<double>(static_cast<std::size_t>(count), common));
  const auto bad = std::ranges::find_if(gaps, [&](double gap) { return gap <= -tile; });
  if (bad != gaps.end()) {
    const double gap = *bad;
    gaps.clear();
    reader.error(listed ? key : "gap_m", fmt::format("overlaps tiles by {} m, a whole tile", -gap),
                 "a negative gap must stay smaller than the tile");
  }
  return gaps;
}

/// The radius of the arc on which columns stand, 0 for a plane; none when it is not sound. `sound`: all the rest of the
/// grid is.
std::optional<double> check_curve(TableReader& reader, const DraftGrid& draft, const WallGrid& grid, bool sound) {
  const TomlValue* const table = reader.find("curve");
  if (table == nullptr) return 0.0;
  if (table->type != TomlValue::Type::Table) return std::nullopt;
  constexpr double kDegree = std::numbers::pi / 180.0;
  TableReader curve(*table, "curve", reader.findings());
  if (curve.has("radius_m") == curve.has("angle_degrees")) {
    reader.findings().error(table->position, "curve has either radius_m or angle_degrees",
                            "write e.g. curve = { radius_m = 3.0 } or curve = { angle_degrees = 90 }");
    return std::nullopt;
  }
  if (!sound || (!draft.radius_m && !draft.angle_degrees)) return std::nullopt;
  if (draft.angle_degrees) {
    const auto found = radius_of_arc(grid, *draft.angle_degrees * kDegree);
    if (!found) {
      curve.error("angle_degrees", fmt::format("is {}, which no arc of these columns has", *draft.angle_degrees),
                  "give the radius instead, or check the columns' widths and gaps");
    }
    return found;
  }
  if (fits_arc(grid, *draft.radius_m)) return draft.radius_m;
  curve.error("radius_m", fmt::format("is {}, and the columns go more than once around", *draft.radius_m),
              "the radius must be larger, or the columns fewer");
  return std::nullopt;
}

/// The grid with gaps and an arc; none when something about it is wrong.
std::optional<WallGrid> check_grid(TableReader& reader, const DraftGrid& draft) {
  if (draft.tile_size_m && !draft.is_sized()) {
    reader.error("tile_size_m", fmt::format("is {} x {} m", (*draft.tile_size_m)[0], (*draft.tile_size_m)[1]),
                 "sizes must be positive, and at least a thousandth of a millimetre");
  }
  if (draft.screens() > draft.max_screens) {
    reader.error("columns", fmt::format("times rows is {} screens", draft.screens()),
                 fmt::format("a wall may have {} in all", kMaxScreens));
  }
  WallGrid grid;
  grid.center = draft.center;
  if (draft.is_countable() && draft.is_sized()) {
    const std::vector<double> gap = draft.gap_m.value_or(std::vector<double>{0.0, 0.0});
    grid.columns = *draft.columns;
    grid.rows = *draft.rows;
    grid.column_gaps_m =
        check_gaps(reader, "column_gaps_m", draft.column_gaps_m, grid.columns - 1, gap[0], (*draft.tile_size_m)[0]);
    grid.row_gaps_m =
        check_gaps(reader, "row_gaps_m", draft.row_gaps_m, grid.rows - 1, gap[1], (*draft.tile_size_m)[1]);
  }
  if (draft.tile_pixels && draft.is_sized()) {
    grid.tile_pixels = *draft.tile_pixels;
    grid.tile_width_m = (*draft.tile_size_m)[0];
    grid.tile_height_m = (*draft.tile_size_m)[1];
  }
  const bool spaced = draft.is_countable() && std::ssize(grid.column_gaps_m) == *draft.columns - 1 &&
                      std::ssize(grid.row_gaps_m) == *draft.rows - 1;
  const bool sound = draft.tile_pixels && draft.is_sized() && spaced;
  const auto radius = check_curve(reader, draft, grid, sound);
  if (!sound || !radius) return std::nullopt;
  grid.radius_m = *radius;
  return grid;
}

void read_grid(TableReader& surface_reader, const std::string& surface, const std::filesystem::path& folder,
               WallDraft& draft) {
  const TomlValue* const table = surface_reader.table("grid");
  if (table == nullptr) return;
  TableReader reader(*table, std::string(grid_keys().name), surface_reader.findings());
  DraftGrid tiles;
  tiles.max_screens = std::max(0, kMaxScreens - static_cast<int>(draft.screens.size()));
  read_keys(grid_keys(), reader, folder, tiles);
  const auto grid = check_grid(reader, tiles);
  if (!tiles.is_countable()) return;
  const auto count = static_cast<std::size_t>(tiles.screens());
  if (tiles.windows && tiles.windows->size() != count) {
    reader.error(
        "windows",
        fmt::format("names {} windows for {} x {} screens", tiles.windows->size(), *tiles.columns, *tiles.rows),
        fmt::format("name {}, row by row from the top left", count));
    return;
  }
  if (!grid) return;
  const TomlValue* const list = reader.find("windows");
  std::vector<WallScreen> screens = expand_grid(*grid, surface);
  for (std::size_t i = 0; i < screens.size(); ++i) {
    DraftScreen screen{tiles.tile, table->position, table->position, table->position, true};
    screen.screen.id = std::move(screens[i].id);
    screen.screen.surface = surface;
    screen.screen.pixels = screens[i].pixels;
    screen.screen.lower_left = screens[i].lower_left;
    screen.screen.lower_right = screens[i].lower_right;
    screen.screen.upper_left = screens[i].upper_left;
    screen.screen.viewport = screens[i].viewport;
    if (tiles.windows) {
      screen.screen.window = (*tiles.windows)[i];
      screen.window_position = list->items[i].position;
    }
    draft.screens.push_back(std::move(screen));
  }
}

/// Whether a screen's sides are long enough and meet at a right angle.
bool is_rectangle(TableReader& reader, const WallScreen& screen) {
  const glm::dvec3 right = screen.lower_right - screen.lower_left;
  const glm::dvec3 up = screen.upper_left - screen.lower_left;
  if (glm::length(right) < kMinSide_m || glm::length(up) < kMinSide_m) {
    reader.error("corners_m", fmt::format("span {} x {} m", glm::length(right), glm::length(up)),
                 "a screen has a positive width (ll to lr) and height (ll to ul)");
    return false;
  }
  const double cosine = glm::dot(right, up) / (glm::length(right) * glm::length(up));
  if (std::abs(cosine) <= kMaxCosine) return true;
  const double angle = std::acos(cosine) * 180.0 / std::numbers::pi;
  reader.error("corners_m", fmt::format("meet at {:.5g} degrees, not at a right angle", angle),
               "measure ll, lr and ul again; a skewed picture would need a warp");
  return false;
}

/// Whether the corners that were read make a rectangle; what is wrong is a finding, and the corners are none then.
bool check_corners(TableReader& reader, WallScreen& screen) {
  const auto corners = {&screen.lower_left, &screen.lower_right, &screen.upper_left};
  const bool complete = std::ranges::none_of(corners, [](const glm::dvec3* p) { return std::isnan(p->x); });
  const bool sound = complete && is_rectangle(reader, screen);
  if (!sound) {
    for (glm::dvec3* const corner : corners) *corner = glm::dvec3(0.0);
  }
  return sound;
}

void warn_about_pixel_shape(const DraftScreen& draft, Findings& findings) {
  constexpr double kSquareEnough = 0.02;
  const WallScreen& screen = draft.screen;
  const double x = screen_width(screen) / screen.pixels.width;
  const double y = screen_height(screen) / screen.pixels.height;
  if (std::abs(x / y - 1.0) <= kSquareEnough) return;
  const double turned = screen_width(screen) / screen.pixels.height / (screen_height(screen) / screen.pixels.width);
  findings.warning(
      draft.position,
      fmt::format("the pixels of screen \"{}\" are {:.4g} x {:.4g} mm, not square", screen.id, 1000.0 * x, 1000.0 * y),
      std::abs(turned - 1.0) <= kSquareEnough
          ? "give the pixels of the upright picture, width along ll to lr: swap the two numbers"
          : "check pixels and metres of the lit area");
}

/// What a surface has instead of a grid, or in error beside it.
void read_screens(TableReader& surface, const std::string& surface_id, const std::filesystem::path& folder,
                  WallDraft& draft) {
  const bool has_grid = surface.has("grid");
  const std::size_t before = draft.screens.size();
  if (has_grid == surface.has("screens")) {
    surface.findings().error(surface.position(),
                             fmt::format("surface \"{}\" has {}", surface_id,
                                         has_grid ? "both a grid and screens" : "neither a grid nor screens"),
                             "give either grid = { ... } or screens = [ ... ]");
  }
  for (const TomlValue* const table : surface.tables("screens")) {
    TableReader reader(*table, std::string(screen_keys().name), surface.findings());
    DraftScreen draft_screen{{}, table->position, reader.position("window"), reader.position("warp"), false};
    WallScreen& screen = draft_screen.screen;
    screen.surface = surface_id;
    screen.lower_left = screen.lower_right = screen.upper_left = glm::dvec3(std::numeric_limits<double>::quiet_NaN());
    read_keys(screen_keys(), reader, folder, screen);
    draft_screen.has_corners = check_corners(reader, screen) && screen.pixels.area() > 0;
    draft.screens.push_back(std::move(draft_screen));
  }
  if (surface.has("screens") && !has_grid && draft.screens.size() == before) {
    surface.error("screens", "hold no screen", "add one, or remove the surface");
  }
}

/// Pixels of the screens from `first` on that are no squares. A grid's tiles are alike: one warning does.
void warn_about_pixel_shapes(const WallDraft& draft, std::size_t first, bool of_grid, Findings& findings) {
  const std::size_t end = of_grid ? std::min(first + 1, draft.screens.size()) : draft.screens.size();
  for (std::size_t i = first; i < end; ++i) {
    // Where a mesh says where the light falls, corners only say so about.
    const bool measured = !draft.screens[i].screen.warp.mesh.path.empty();
    if (draft.screens[i].has_corners && !measured) warn_about_pixel_shape(draft.screens[i], findings);
  }
}

void read_surfaces(TableReader& document, const std::filesystem::path& folder, WallDraft& draft) {
  Findings& findings = document.findings();
  const std::vector<const TomlValue*> surfaces = document.tables("surfaces");
  for (const TomlValue* const table : surfaces) {
    TableReader reader(*table, std::string(surface_keys().name), findings);
    if (surfaces.size() > 1) reader.require("id", "\"wall\"");
    DraftSurface surface{.id = "wall", .position = table->position, .viewer_position = reader.position("viewer")};
    const std::size_t before = draft.screens.size();
    read_keys(surface_keys(), reader, folder, surface, [&](std::string_view key) {
      if (key == "grid") read_grid(reader, surface.id, folder, draft);
      if (key == "screens") read_screens(reader, surface.id, folder, draft);
    });
    draft.surfaces.push_back(surface);
    warn_about_pixel_shapes(draft, before, reader.has("grid"), findings);
  }
  if (document.has("surfaces") && draft.screens.empty() && !findings.any_errors()) {
    document.error("surfaces", "hold no screen", "add a grid or screens");
  }
}

void read_viewers(TableReader& document, const std::filesystem::path& folder, WallDraft& draft) {
  for (const TomlValue* const table : document.tables("viewers")) {
    TableReader reader(*table, std::string(viewer_keys().name), document.findings());
    WallViewer viewer;
    read_keys(viewer_keys(), reader, folder, viewer);
    draft.viewers.push_back({std::move(viewer), table->position, reader.has("position_m")});
  }
}

/// A recorded path for the first viewer, whatever tracks them otherwise.
void read_viewer_path(TableReader& document, const std::filesystem::path& folder, WallDraft& draft) {
  const TomlValue* const table = document.find("test");
  if (table == nullptr || table->type != TomlValue::Type::Table) return;
  TableReader reader(*table, "test", document.findings());
  if (!reader.has("viewer_path")) return;
  if (draft.viewers.empty()) draft.viewers.push_back({{}, table->position});
  WallTracker recorded;
  read_head_recording({reader, "viewer_path", folder}, recorded);
  draft.viewers.front().viewer.tracker = recorded;
}

TextPosition position_of_stereo(TableReader& document) {
  const TomlValue* const stereo = document.find("stereo");
  return stereo == nullptr ? TextPosition{} : TableReader(*stereo, "stereo", document.findings()).position("mode");
}

void read_monitors(TableReader& document, const std::filesystem::path& folder, WallDraft& draft) {
  for (const TomlValue* const table : document.tables("monitors")) {
    TableReader reader(*table, std::string(monitor_keys().name), document.findings());
    DraftMonitor monitor{{}, table->position, reader.position("surface")};
    read_keys(monitor_keys(), reader, folder, monitor.monitor);
    if (reader.has("rect") == reader.has("pixels")) {
      document.findings().error(table->position, "a monitor has either a rect or pixels",
                                "write rect = [x, y, width, height] on its display, or pixels = [1920, 540]");
    }
    const Size size = monitor.monitor.pixels;
    if (size.width > kMaxScreenSide || size.height > kMaxScreenSide) {
      reader.error("rect", fmt::format("is {} x {} pixels", size.width, size.height),
                   fmt::format("a monitor has at most {} a side", kMaxScreenSide));
    }
    draft.monitors.push_back(std::move(monitor));
  }
}

}  // namespace

void read_document(TableReader& document, const std::filesystem::path& folder, WallDraft& draft, Wall& wall) {
  read_keys(wall_keys(), document, folder, wall, [&](std::string_view key) {
    if (key == "nodes") read_nodes(document, folder, draft);
    if (key == "windows") read_windows(document, folder, draft);
    if (key == "surfaces") read_surfaces(document, folder, draft);
    if (key == "viewers") read_viewers(document, folder, draft);
    if (key == "stereo") draft.stereo_position = position_of_stereo(document);
    if (key == "test") read_viewer_path(document, folder, draft);
    if (key == "monitors") read_monitors(document, folder, draft);
  });
  draft.stereo = wall.stereo;
}

}  // namespace hpr
