#include "walls/display.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/error.h"
#include "core/names.h"
#include "walls/displays/file_display.h"
#include "walls/displays/no_display.h"
#include "walls/displays/pipe_display.h"
#include "walls/displays/web_display.h"
#include "walls/displays/window_display.h"

namespace hpr {

OrbitInput& OrbitInput::operator+=(const OrbitInput& other) {
  turn_right += other.turn_right;
  turn_up += other.turn_up;
  pan_right += other.pan_right;
  pan_up += other.pan_up;
  dolly += other.dolly;
  return *this;
}

std::vector<const Image<Rgba8>*> pictures_by_screen(const Wall& wall, const WallFrame& frame) {
  std::vector<const Image<Rgba8>*> pictures(wall.screens.size(), nullptr);
  for (const ScreenPicture& picture : frame.screens) pictures.at(picture.screen) = &picture.image;
  return pictures;
}

const std::vector<DisplayKind>& display_kinds() {
  static const std::vector<DisplayKind> kinds{
      {"file", false, false, make_file_display, check_file_display},
      {"window", false, true, make_window_display, check_window_display},
      {"web", true, true, make_web_display, check_web_display},
      {"pipe", true, false, make_pipe_display, check_pipe_display},
      {"none", false, false, make_no_display, check_no_display},
  };
  return kinds;
}

const std::vector<std::string>& all_displays() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const DisplayKind& kind : display_kinds()) all.emplace_back(kind.name);
    return all;
  }();
  return names;
}

const DisplayKind& find_display(std::string_view name) {
  const auto found = std::ranges::find(display_kinds(), name, &DisplayKind::name);
  if (found != display_kinds().end()) return *found;
  throw Error(ExitCode::Usage, fmt::format("unknown display '{}'", printable(name)),
              unknown_name_hint(name, all_displays()));
}

std::unique_ptr<Display> make_display(std::string_view name, const Wall& wall, const DisplayOptions& options) {
  return find_display(name).make(wall, options);
}

void check_display(std::string_view name, const Wall& wall, const DisplayOptions& options) {
  find_display(name).check(wall, options);
}

}  // namespace hpr
