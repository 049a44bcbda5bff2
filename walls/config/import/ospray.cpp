#include <fmt/format.h>

#include <algorithm>
#include <glm/geometric.hpp>

#include "walls/config/import/foreign_wall.h"
#include "walls/config/toml_reader.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

glm::dvec3 read_point(const JsonFile& file, const Json& entry, const std::string& path, const char* key) {
  const std::vector<Json>& values = file.array(entry, path, key);
  if (values.size() != 3 || !std::ranges::all_of(values, &Json::is_number)) {
    file.fail(path + "/" + key, "it is not three numbers", "write e.g. [-1.0, 0.5, 2.0], in metres");
  }
  return {values[0].get<double>(), values[1].get<double>(), values[2].get<double>()};
}

/// The corners are of the frame; mullions are what it hides on each side.
WallScreen read_screen(const JsonFile& file, const Json& entry, const std::string& path) {
  const glm::dvec3 top_left = read_point(file, entry, path, "topLeft");
  const glm::dvec3 bottom_left = read_point(file, entry, path, "botLeft");
  const glm::dvec3 bottom_right = read_point(file, entry, path, "botRight");
  const double width = glm::distance(bottom_left, bottom_right);
  const double height = glm::distance(bottom_left, top_left);
  const auto mullion = [&](const char* key, double most) {
    return file.real(entry, path, key, -kMaxMeters, 0.5 * most, 0.0);
  };
  if (!(width > 0.0) || !(height > 0.0)) file.fail(path, "its corners coincide", "give a screen a width and a height");
  const glm::dvec3 right = (bottom_right - bottom_left) / width;
  const glm::dvec3 up = (top_left - bottom_left) / height;
  const double from_left = mullion("mullionLeft", width);
  const double from_bottom = mullion("mullionBottom", height);
  WallScreen screen;
  screen.surface = "wall";
  screen.lower_left = bottom_left + from_left * right + from_bottom * up;
  screen.lower_right = bottom_right - mullion("mullionRight", width) * right + from_bottom * up;
  screen.upper_left = top_left + from_left * right - mullion("mullionTop", height) * up;
  square_corners(screen);
  screen.pixels = {file.integer(entry, path, "screenWidth", 1, kMaxScreenSide),
                   file.integer(entry, path, "screenHeight", 1, kMaxScreenSide)};
  screen.viewport = {0, 0, screen.pixels.width, screen.pixels.height};
  return screen;
}

WallWindow read_window(const JsonFile& file, const Json& entry, const std::string& path, Size pixels) {
  WallWindow window;
  const int x = file.integer(entry, path, "screenX", -kMaxScreenSide, kMaxScreenSide, 0);
  const int y = file.integer(entry, path, "screenY", -kMaxScreenSide, kMaxScreenSide, 0);
  window.rect = {x, y, x + pixels.width, y + pixels.height};
  window.display = fmt::format(":0.{}", file.integer(entry, path, "display", 0, kMaxScreens, 0));
  return window;
}

/// OSPRay Studio's branch for immersive walls (Nam, TACC): one entry per MPI rank, metres.
ImportedWall import_ospray(std::string_view text, const std::string& name, const ImportSettings& /*settings*/) {
  const JsonFile file(text, name);
  const Json& entries = file.root();
  if (!entries.is_array() || entries.empty()) {
    file.fail("", "it is no list of screens", "is it OSPRay Studio's display_settings.json?");
  }
  ImportedWall imported;
  Wall& wall = imported.wall;
  wall.name = "OSPRay Studio wall";
  bool several_eyes = false;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const std::string path = fmt::format("/{}", i);
    const Json& entry = file.object(entries[i], path);
    if (entries.size() > 1 && file.boolean(entry, path, "showUI")) {
      imported.remarks.push_back(
          fmt::format("Screen {} shows the user interface beside the wall and was left out.", i));
      continue;
    }
    WallScreen screen = read_screen(file, entry, path);
    screen.id = fmt::format("screen{}", i);
    screen.window = fmt::format("w{}", i);
    WallWindow window = read_window(file, entry, path, screen.pixels);
    window.id = screen.window;
    window.node = node_of_host(wall, file.text(entry, path, "hostName", "localhost"));
    if (entry.contains("eye")) {
      const glm::dvec3 eye = read_point(file, entry, path, "eye");
      several_eyes = several_eyes ||
                     (wall.viewers.front().has_position && glm::distance(eye, wall.viewers.front().position) > 1e-9);
      if (!wall.viewers.front().has_position) wall.viewers.front().position = eye;
      wall.viewers.front().has_position = true;
    }
    wall.windows.push_back(std::move(window));
    wall.screens.push_back(std::move(screen));
  }
  if (wall.screens.empty()) file.fail("", "all its screens show the user interface", "name a file of a wall");
  if (several_eyes) imported.remarks.emplace_back("Screens have different eyes: the first one's is the viewer.");
  imported.remarks.emplace_back("\"display\" is a monitor's number there: it became the screen of X display :0.");
  return imported;
}

}  // namespace

WallImporter ospray_importer() {
  return {"ospray", "osprstudio", "OSPRay Studio's display_settings.json", import_ospray};
}

}  // namespace hpr
