#include "walls/config/import/foreign_wall.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <glm/geometric.hpp>
#include <sstream>

#include "core/error.h"
#include "core/text.h"
#include "walls/config/toml_document.h"
#include "walls/config/wall_draft.h"

namespace hpr {

void throw_in_file(std::string_view text, const std::string& name, int line, std::string_view what, std::string hint) {
  if (line < 1) throw Error(ExitCode::BadInput, fmt::format("{}: {}", name, what), std::move(hint));
  throw Error(ExitCode::BadInput, fmt::format("{}:{}: {}", name, line, what), std::move(hint),
              printable(text_line(text, line), 200));
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
  WallGrid metric;
  metric.columns = grid.columns * grid.panels.width;
  metric.rows = grid.rows * grid.panels.height;
  metric.tile_pixels = grid.panel;
  metric.tile_width_m = grid.panel.width * grid.pitch_m;
  metric.tile_height_m = grid.panel.height * grid.pitch_m;
  metric.column_gaps_m.assign(static_cast<std::size_t>(metric.columns) - 1, grid.gap_x_pixels * grid.pitch_m);
  metric.row_gaps_m.assign(static_cast<std::size_t>(metric.rows) - 1, grid.gap_y_pixels * grid.pitch_m);
  metric.center.x = grid.left_m + 0.5 * grid_width(grid);
  std::vector<WallScreen> screens = expand_grid(metric, grid.surface);
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
        const int index = row * metric.columns + column;
        WallScreen& screen = screens[static_cast<std::size_t>(index)];
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

JsonFile::JsonFile(std::string_view text, std::string name) : name_(std::move(name)) {
  try {
    root_ = Json::parse(text);
  } catch (const JsonError& error) {
    if (!error.offset()) {
      throw_in_file(text, name_, 0, "it holds numbers or text beyond what JSON allows",
                    "mend the file, or name another kind with --from");
    }
    const std::string_view read = text.substr(0, *error.offset() + 1);
    throw_in_file(text, name_, 1 + static_cast<int>(std::ranges::count(read, '\n')), "it is no JSON",
                  "mend the line, or name another kind with --from");
  }
}

const std::vector<Json>& JsonFile::array(const Json& object, const std::string& path, const char* key) const {
  static const std::vector<Json> none;
  const Json* const found = object.find(key);
  if (found == nullptr) return none;
  if (!found->is_array()) fail(path + "/" + key, "it is no list", "write [ ... ]");
  return found->elements();
}

std::string JsonFile::text(const Json& object, const std::string& path, const char* key,
                           const std::string& otherwise) const {
  const Json* const found = object.find(key);
  if (found == nullptr) return otherwise;
  if (!found->is_string()) fail(path + "/" + key, "it is no text", "write \"...\"");
  return found->get<std::string>();
}

bool JsonFile::boolean(const Json& object, const std::string& path, const char* key) const {
  const Json* const found = object.find(key);
  if (found == nullptr) return false;
  if (!found->is_boolean()) fail(path + "/" + key, "it is neither true nor false", "write true or false");
  return found->get<bool>();
}

int JsonFile::integer(const Json& object, const std::string& path, const char* key, int low, int high,
                      std::optional<int> otherwise) const {
  const std::optional<double> other = otherwise ? std::optional<double>(*otherwise) : std::nullopt;
  const double value = real(object, path, key, low, high, other);
  if (value != std::floor(value)) fail(path + "/" + key, fmt::format("it is {}", value), "give it a whole number");
  return static_cast<int>(value);
}

double JsonFile::real(const Json& object, const std::string& path, const char* key, double low, double high,
                      std::optional<double> otherwise) const {
  const Json* const found = object.find(key);
  if (found == nullptr && otherwise) return *otherwise;
  const std::string hint = fmt::format("give it a number from {} to {}", low, high);
  if (found == nullptr) fail(path, fmt::format("it has no \"{}\"", key), hint);
  if (!found->is_number()) fail(path + "/" + key, "it is no number", hint);
  const auto value = found->get<double>();
  if (!(value >= low && value <= high)) fail(path + "/" + key, fmt::format("it is {}", value), hint);
  return value;
}

const Json& JsonFile::object(const Json& value, const std::string& path) const {
  if (!value.is_object()) fail(path, "it is no object", "write { ... }");
  return value;
}

void JsonFile::fail(const std::string& path, std::string_view what, std::string hint) const {
  throw_in_file({}, name_, 0, fmt::format("{}: {}", path.empty() ? "/" : path, what), std::move(hint));
}

XmlFile::XmlFile(std::string_view text, std::string name) : text_(text), name_(std::move(name)) {
  if (document_.Parse(text.data(), text.size()) == tinyxml2::XML_SUCCESS) return;
  throw_in_file(text_, name_, document_.ErrorLineNum(), fmt::format("it is no XML ({})", document_.ErrorName()),
                "mend the file, or name another kind with --from");
}

const tinyxml2::XMLElement& XmlFile::root(const char* called) const {
  const tinyxml2::XMLElement* const element = document_.RootElement();
  const std::string hint = "is it a file of that kind? name another one with --from";
  if (element == nullptr) throw_in_file(text_, name_, 0, fmt::format("it has no <{}>", called), hint);
  if (element->Name() != std::string_view(called)) {
    fail(*element, fmt::format("<{}> stands where <{}> was expected", printable(element->Name()), called), hint);
  }
  return *element;
}

const tinyxml2::XMLElement& XmlFile::child(const tinyxml2::XMLElement& parent, const char* called) const {
  const tinyxml2::XMLElement* const element = parent.FirstChildElement(called);
  if (element == nullptr) {
    fail(parent, fmt::format("<{}> has no <{}>", parent.Name(), called), fmt::format("add a <{}>", called));
  }
  return *element;
}

std::vector<const tinyxml2::XMLElement*> XmlFile::children(const tinyxml2::XMLElement& parent, const char* called) {
  std::vector<const tinyxml2::XMLElement*> found;
  for (auto* child = parent.FirstChildElement(called); child != nullptr; child = child->NextSiblingElement(called)) {
    found.push_back(child);
  }
  return found;
}

std::string XmlFile::text(const tinyxml2::XMLElement& element, const char* attribute) {
  const char* const value = element.Attribute(attribute);
  return value != nullptr ? value : "";
}

int XmlFile::integer(const tinyxml2::XMLElement& element, const char* attribute, int low, int high,
                     std::optional<int> otherwise) const {
  const std::string value = text(element, attribute);
  if (value.empty() && otherwise) return *otherwise;
  int number = 0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (error != std::errc() || end != value.data() + value.size() || number < low || number > high) {
    const std::string what = value.empty() ? fmt::format("<{}> has no {}", element.Name(), attribute)
                                           : fmt::format("{} is '{}'", attribute, printable(value));
    fail(element, what, fmt::format("give it a whole number from {} to {}", low, high));
  }
  return number;
}

std::optional<glm::dvec3> XmlFile::point(const tinyxml2::XMLElement& element, const char* attribute) const {
  const std::string value = text(element, attribute);
  if (value.empty()) return std::nullopt;
  std::istringstream stream(value);
  stream.imbue(std::locale::classic());
  glm::dvec3 read(0.0);
  std::string rest;
  const bool sound = static_cast<bool>(stream >> read.x >> read.y >> read.z) && !(stream >> rest) &&
                     std::isfinite(read.x + read.y + read.z);
  if (!sound) {
    fail(element, fmt::format("{} is '{}', not three numbers", attribute, printable(value)),
         fmt::format("write e.g. {}=\"-1.0 0.0 -1.0\"", attribute));
  }
  return read;
}

void XmlFile::fail(const tinyxml2::XMLElement& element, std::string_view what, std::string hint) const {
  throw_in_file(text_, name_, element.GetLineNum(), what, std::move(hint));
}

}  // namespace hpr
