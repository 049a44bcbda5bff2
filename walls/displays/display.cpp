#include "walls/displays/display.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/error.h"
#include "core/text.h"
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

const std::vector<DisplayKind>& display_kinds() {
  static const std::vector<DisplayKind> kinds{
      {.name = "file", .monitors = true, .make = make_file_display, .check = check_file_display},
      {.name = "window", .interactive = true, .make = make_window_display, .check = check_window_display},
      {.name = "web", .whole_wall = true, .interactive = true, .make = make_web_display, .check = check_web_display},
      {.name = "pipe", .whole_wall = true, .stream = true, .make = make_pipe_display, .check = check_pipe_display},
      {.name = "none", .make = make_no_display, .check = check_no_display},
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

const DisplayKind& find_display(std::string_view name, std::span<const std::string> further) {
  const auto found = std::ranges::find(display_kinds(), name, &DisplayKind::name);
  if (found != display_kinds().end()) return *found;
  std::vector<std::string> choices = all_displays();
  choices.insert(choices.end(), further.begin(), further.end());
  throw Error(ExitCode::Usage, fmt::format("unknown display '{}'", printable(name)), unknown_name_hint(name, choices));
}

}  // namespace hpr
