#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "walls/config/wall_draft.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

constexpr double kMetresLimit = 1e6;
/// A picture on skewed corners would need a warp; this much is measuring noise.
constexpr double kPerpendicular = 1e-6;

std::optional<Size> read_pixels(TableReader& reader, std::string_view key) {
  reader.require(key, "[1920, 1080]");
  const auto numbers = reader.integers(key, 2, 1, kMostScreenSide);
  if (!numbers) return std::nullopt;
  return Size{(*numbers)[0], (*numbers)[1]};
}

/// `count` gaps: all `common`, unless listed one by one under `key`. Empty when one overlaps a whole tile.
std::vector<double> read_gaps(TableReader& reader, std::string_view key, int count, double common, double tile) {
  const auto listed = reader.reals(key, static_cast<std::size_t>(count), kMetresLimit);
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

/// How the columns stand; 0 for a plane. Asked for last: it needs all the rest of the grid.
std::optional<double> read_curve(TableReader& reader, const WallGrid& grid, bool sound, Findings& findings) {
  const TomlValue* const table = reader.table("curve");
  if (table == nullptr) return 0.0;
  constexpr double kDegree = std::numbers::pi / 180.0;
  TableReader curve(*table, "curve", findings);
  const auto radius = curve.real("radius_m", 0.0, kMetresLimit);
  const auto degrees = curve.real("angle_degrees", 0.0, 360.0);
  curve.finish();
  if (curve.has("radius_m") == curve.has("angle_degrees")) {
    findings.error(table->place, "curve has either radius_m or angle_degrees",
                   "write e.g. curve = { radius_m = 3.0 } or curve = { angle_degrees = 90 }");
    return std::nullopt;
  }
  if (!sound || (!radius && !degrees)) return std::nullopt;
  if (degrees) {
    const auto found = radius_of_arc(grid, *degrees * kDegree);
    if (!found) {
      curve.error("angle_degrees", fmt::format("is {}, which no arc of these columns has", *degrees),
                  "give the radius instead, or check the columns' widths and gaps");
    }
    return found;
  }
  if (fits_arc(grid, *radius)) return radius;
  curve.error("radius_m", fmt::format("is {}, and the columns go more than once around", *radius),
              "the radius must be larger, or the columns fewer");
  return std::nullopt;
}

/// How the tiles of a grid stand and show, all alike.
WallScreen read_tiles_look(TableReader& reader, Findings& findings) {
  const bool turned_twice = reader.has("rotate") && reader.has("panel_rotate");
  if (turned_twice) reader.error("panel_rotate", "stands beside rotate", "they mean the same: remove one");
  WallScreen look;
  read_look(reader, reader.has("panel_rotate") ? "panel_rotate" : "rotate", look, findings);
  return look;
}

void read_grid(const TomlValue& table, const std::string& surface, WallDraft& draft, Findings& findings) {
  TableReader reader(table, "grid", findings);
  WallGrid grid;
  reader.require("columns", "3");
  reader.require("rows", "2");
  const auto columns = reader.integer("columns", 1, kMostScreens);
  const auto rows = reader.integer("rows", 1, kMostScreens);
  const auto pixels = read_pixels(reader, "tile_pixels");
  reader.require("tile_size_m", "[1.2096, 0.6804]");
  const auto size = reader.reals("tile_size_m", 2, kMetresLimit);
  const bool positive = size && (*size)[0] >= kSmallestSide_m && (*size)[1] >= kSmallestSide_m;
  if (size && !positive) {
    reader.error("tile_size_m", fmt::format("is {} x {} m", (*size)[0], (*size)[1]),
                 "sizes must be positive, and at least a thousandth of a millimetre");
  }
  const std::vector<double> gap = reader.reals("gap_m", 2, kMetresLimit).value_or(std::vector<double>{0.0, 0.0});
  grid.center = reader.point("centre_m").value_or(glm::dvec3(0.0));
  const WallScreen look = read_tiles_look(reader, findings);
  const auto windows = reader.texts("windows");
  const std::int64_t asked = std::int64_t{columns.value_or(1)} * rows.value_or(1);
  const bool fits = asked + static_cast<std::int64_t>(draft.screens.size()) <= kMostScreens;
  if (!fits) {
    reader.error("columns", fmt::format("times rows is {} screens", asked),
                 fmt::format("a wall may have {} in all", kMostScreens));
  }
  const bool countable = columns && rows && fits;
  if (countable && positive) {
    grid.columns = *columns;
    grid.rows = *rows;
    grid.column_gaps_m = read_gaps(reader, "column_gaps_m", *columns - 1, gap[0], (*size)[0]);
    grid.row_gaps_m = read_gaps(reader, "row_gaps_m", *rows - 1, gap[1], (*size)[1]);
  }
  for (const std::string_view key : {"column_gaps_m", "row_gaps_m"}) static_cast<void>(reader.has(key));
  const bool spaced =
      countable && std::ssize(grid.column_gaps_m) == *columns - 1 && std::ssize(grid.row_gaps_m) == *rows - 1;
  if (pixels && positive) {
    grid.tile_pixels = *pixels;
    grid.tile_width_m = (*size)[0];
    grid.tile_height_m = (*size)[1];
  }
  const auto radius = read_curve(reader, grid, pixels && positive && spaced, findings);
  reader.finish();
  if (!countable) return;
  const auto count = static_cast<std::size_t>(asked);
  if (windows && windows->size() != count) {
    reader.error("windows", fmt::format("names {} windows for {} x {} screens", windows->size(), *columns, *rows),
                 fmt::format("name {}, row by row from the top left", count));
    return;
  }
  if (!pixels || !positive || !spaced || !radius) return;
  grid.radius_m = *radius;
  const TomlValue* const list = reader.find("windows");
  std::vector<WallScreen> screens = expand_grid(grid, surface);
  for (std::size_t i = 0; i < screens.size(); ++i) {
    DraftScreen screen{std::move(screens[i]), table.place, table.place, table.place, true};
    screen.screen.rotate = look.rotate;
    screen.screen.mirror = look.mirror;
    screen.screen.eye = look.eye;
    screen.screen.color = look.color;
    screen.screen.blend = look.blend;
    if (windows) {
      screen.screen.window = (*windows)[i];
      screen.window_place = list->items[i].place;
    }
    draft.screens.push_back(std::move(screen));
  }
}

/// Reads the three corners; false when they are missing or make no rectangle.
bool read_corners(TableReader& reader, WallScreen& screen, Findings& findings) {
  reader.require("corners_m", "{ ll = [x, y, z], lr = [x, y, z], ul = [x, y, z] }");
  const TomlValue* const table = reader.table("corners_m");
  if (table == nullptr) return false;
  TableReader corners(*table, "corners_m", findings);
  for (const std::string_view key : {"ll", "lr", "ul"}) corners.require(key, "[x, y, z]");
  const auto ll = corners.point("ll");
  const auto lr = corners.point("lr");
  const auto ul = corners.point("ul");
  corners.finish();
  if (!ll || !lr || !ul) return false;
  const glm::dvec3 right = *lr - *ll;
  const glm::dvec3 up = *ul - *ll;
  if (glm::length(right) < kSmallestSide_m || glm::length(up) < kSmallestSide_m) {
    reader.error("corners_m", fmt::format("span {} x {} m", glm::length(right), glm::length(up)),
                 "a screen has a positive width (ll to lr) and height (ll to ul)");
    return false;
  }
  const double cosine = glm::dot(right, up) / (glm::length(right) * glm::length(up));
  if (std::abs(cosine) > kPerpendicular) {
    const double angle = std::acos(cosine) * 180.0 / 3.14159265358979323846;
    reader.error("corners_m", fmt::format("meet at {:.5g} degrees, not at a right angle", angle),
                 "measure ll, lr and ul again; a skewed picture would need a warp");
    return false;
  }
  screen.lower_left = *ll;
  screen.lower_right = *lr;
  screen.upper_left = *ul;
  return true;
}

void warn_about_pixel_shape(const DraftScreen& draft, Findings& findings) {
  constexpr double kSquareEnough = 0.02;
  const WallScreen& screen = draft.screen;
  const double x = screen_width(screen) / screen.pixels.width;
  const double y = screen_height(screen) / screen.pixels.height;
  if (std::abs(x / y - 1.0) <= kSquareEnough) return;
  const double turned = screen_width(screen) / screen.pixels.height / (screen_height(screen) / screen.pixels.width);
  findings.warning(
      draft.place,
      fmt::format("the pixels of screen \"{}\" are {:.4g} x {:.4g} mm, not square", screen.id, 1000.0 * x, 1000.0 * y),
      std::abs(turned - 1.0) <= kSquareEnough
          ? "give the pixels of the upright picture, width along ll to lr: swap the two numbers"
          : "check pixels and metres of the lit area");
}

void read_screens(TableReader& surface, const std::string& surface_id, const std::filesystem::path& folder,
                  WallDraft& draft, Findings& findings) {
  for (const TomlValue* const table : surface.tables("screens")) {
    TableReader reader(*table, "screen", findings);
    DraftScreen draft_screen{{}, table->place, reader.place("window"), reader.place("warp"), false};
    WallScreen& screen = draft_screen.screen;
    reader.require("id", "\"left\"");
    screen.id = reader.id("id").value_or("");
    screen.surface = surface_id;
    const auto pixels = read_pixels(reader, "pixels");
    screen.pixels = pixels.value_or(Size{});
    draft_screen.has_corners = read_corners(reader, screen, findings) && pixels;
    screen.window = reader.text("window").value_or("");
    screen.viewport = reader.rect("viewport").value_or(Rect{});
    read_look(reader, "rotate", screen, findings);
    read_warp(reader, folder, screen, findings);
    reader.ignore({"overscan_px"});
    reader.finish();
    draft.screens.push_back(std::move(draft_screen));
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

}  // namespace

void read_surfaces(TableReader& document, const std::filesystem::path& folder, WallDraft& draft, Findings& findings) {
  document.require("surfaces", "[{ id = \"wall\", grid = { ... } }]");
  const std::vector<const TomlValue*> surfaces = document.tables("surfaces");
  for (const TomlValue* const table : surfaces) {
    TableReader reader(*table, "surface", findings);
    if (surfaces.size() > 1) reader.require("id", "\"wall\"");
    const std::string id = reader.id("id").value_or("wall");
    draft.surfaces.push_back({id, table->place, reader.text("viewer").value_or(""), reader.place("viewer")});
    const std::size_t before = draft.screens.size();
    const bool has_grid = reader.has("grid");
    const bool has_screens = reader.has("screens");
    if (has_grid == has_screens) {
      findings.error(
          table->place,
          fmt::format("surface \"{}\" has {}", id, has_grid ? "both a grid and screens" : "neither a grid nor screens"),
          "give either grid = { ... } or screens = [ ... ]");
    }
    if (const TomlValue* const grid = reader.table("grid")) read_grid(*grid, id, draft, findings);
    read_screens(reader, id, folder, draft, findings);
    if (has_screens && !has_grid && draft.screens.size() == before) {
      reader.error("screens", "hold no screen", "add one, or remove the surface");
    }
    reader.ignore({"mpcdi"});
    reader.finish();
    warn_about_pixel_shapes(draft, before, has_grid, findings);
  }
  if (document.has("surfaces") && draft.screens.empty() && !findings.any_errors()) {
    document.error("surfaces", "hold no screen", "add a grid or screens");
  }
}

}  // namespace hpr
