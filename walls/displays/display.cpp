#include "walls/displays/display.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/error.h"
#include "core/text.h"

namespace hpr {

OrbitInput& OrbitInput::operator+=(const OrbitInput& other) {
  turn_right += other.turn_right;
  turn_up += other.turn_up;
  pan_right += other.pan_right;
  pan_up += other.pan_up;
  dolly += other.dolly;
  return *this;
}

ViewKeys& ViewKeys::operator+=(const ViewKeys& other) {
  half_stops += other.half_stops;
  tones += other.tones;
  wireframes += other.wireframes;
  return *this;
}

std::optional<ViewKeys> parse_view_key(char key) {
  switch (key) {
    case '+':
    case '=':  // the same key without shift on many keyboards
      return ViewKeys{.half_stops = 1};
    case '-':
      return ViewKeys{.half_stops = -1};
    case 't':
      return ViewKeys{.tones = 1};
    case 'w':
      return ViewKeys{.wireframes = 1};
    default:
      return std::nullopt;
  }
}

DisplayInput& DisplayInput::operator+=(const DisplayInput& other) {
  orbit += other.orbit;
  keys += other.keys;
  stop = stop || other.stop;
  return *this;
}

const std::vector<DisplayKind>& display_kinds() {
#define HPR_LIST_DISPLAY(name) name##_display(),
  static const std::vector<DisplayKind> kinds{HPR_DISPLAYS(HPR_LIST_DISPLAY)};
#undef HPR_LIST_DISPLAY
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
