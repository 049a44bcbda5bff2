#include "walls/config/wall_template.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <set>

#include "core/error.h"
#include "core/text.h"
#include "walls/config/toml_document.h"
#include "walls/config/toml_reader.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

/// The numbers of a wall with nothing left open.
struct Numbers {
  Size pixels;
  glm::dvec2 size_m{0.0};
  glm::dvec2 gap_m{0.0};
  bool measured = false;  ///< size and gap are the user's
};

double to_tenths_of_mm(double meters) {
  return std::round(meters * 1e4) / 1e4;
}

Numbers numbers_of(const WallTemplate& wall) {
  constexpr double kDiagonal_m = 46.0 * 0.0254;
  constexpr double kDesktopHeight_m = 0.36;
  const bool here = wall.hosts.empty();
  Numbers numbers{wall.tile_pixels.value_or(here ? Size{640, 360} : Size{1920, 1080}), {}, {}, true};
  const glm::dvec2 shape(numbers.pixels.width, numbers.pixels.height);
  const double meters_per_pixel = here ? kDesktopHeight_m / shape.y : kDiagonal_m / std::hypot(shape.x, shape.y);
  const glm::dvec2 guess(to_tenths_of_mm(shape.x * meters_per_pixel), to_tenths_of_mm(shape.y * meters_per_pixel));
  numbers.size_m = wall.tile_size_m.value_or(guess);
  numbers.gap_m = wall.gap_m.value_or(here ? glm::dvec2(0.006) : glm::dvec2(0.0055));
  numbers.measured = wall.tile_size_m && wall.gap_m;
  return numbers;
}

void check(const WallTemplate& wall, const Numbers& numbers) {
  const std::int64_t screens = std::int64_t{wall.columns} * wall.rows;
  if (wall.columns < 1 || wall.rows < 1 || screens > kMaxScreens) {
    throw Error(ExitCode::Usage, fmt::format("a wall cannot have {} x {} screens", wall.columns, wall.rows),
                fmt::format("columns times rows must be from 1 to {}", kMaxScreens));
  }
  const auto [width, height] = numbers.pixels;
  if (width < 1 || height < 1 || width > kMaxScreenSide || height > kMaxScreenSide) {
    throw Error(ExitCode::Usage, fmt::format("a screen cannot have {} x {} pixels", width, height),
                fmt::format("sides must be from 1 to {}", kMaxScreenSide));
  }
  const auto possible = [&](double size, double gap) {
    constexpr double kMaxLength_m = 1000.0;
    return size > 0.0 && size <= kMaxLength_m && gap > -size && gap <= kMaxLength_m;
  };
  if (possible(numbers.size_m.x, numbers.gap_m.x) && possible(numbers.size_m.y, numbers.gap_m.y)) return;
  throw Error(ExitCode::Usage,
              fmt::format("screens of {:g} x {:g} m cannot stand {:g} and {:g} m apart", numbers.size_m.x,
                          numbers.size_m.y, numbers.gap_m.x, numbers.gap_m.y),
              "sizes and gaps are metres, e.g. --tile-size-m 1.018x0.573 --gap-m 0.0055; overlaps are negative gaps");
}

/// Per screen the index of its host.
std::vector<std::size_t> share_out(const WallTemplate& wall) {
  const auto screens = static_cast<std::size_t>(wall.columns) * static_cast<std::size_t>(wall.rows);
  const std::size_t hosts = wall.hosts.size();
  if (wall.tiles_per_host) {
    const auto each = static_cast<std::size_t>(*wall.tiles_per_host);
    const std::size_t needed = (screens + each - 1) / each;
    if (needed != hosts) {
      throw Error(ExitCode::Usage,
                  fmt::format("{} x {} screens, {} a host, take {} hosts, but {} {} named", wall.columns, wall.rows,
                              each, needed, hosts, hosts == 1 ? "is" : "are"),
                  "change --hosts or --tiles-per-host, or leave the latter out to share the screens out evenly");
    }
  } else if (hosts > screens) {
    throw Error(ExitCode::Usage, fmt::format("{} hosts for {} screens", hosts, screens),
                "name no more hosts than screens; add those that only render as nodes to the file");
  }
  std::vector<std::size_t> owners;
  for (std::size_t screen = 0; screen < screens; ++screen) {
    owners.push_back(wall.tiles_per_host ? screen / static_cast<std::size_t>(*wall.tiles_per_host)
                                         : screen * hosts / screens);
  }
  return owners;
}

std::string window_id(const WallTemplate& wall, std::size_t screen) {
  const auto columns = static_cast<std::size_t>(wall.columns);
  return fmt::format("w{}-{}", screen / columns, screen % columns);
}

std::string tables_of_hosts(const WallTemplate& wall, Size pixels) {
  constexpr std::int64_t kMaxDesktopSide = 32767;
  std::string text =
      "\n# One node per computer. host: its name, as `hostname` prints it there. ranks: render processes to run on "
      "it.\n"
      "nodes = [\n";
  for (const std::string& host : wall.hosts) {
    text += fmt::format("  {{ id = {0}, host = {0}, ranks = {1} }},\n", toml_quote(host), wall.ranks_per_host);
  }
  text +=
      "]\n\n# One window per screen. rect: x, y, width, height on that X display; here the panels of a host lie side "
      "by "
      "side, as\n# xrandr should say. monitor = \"DP-1\" names an output instead.\nwindows = [\n";
  const std::vector<std::size_t> owners = share_out(wall);
  int beside = 0;
  for (std::size_t screen = 0; screen < owners.size(); ++screen) {
    beside = screen > 0 && owners[screen] == owners[screen - 1] ? beside + 1 : 0;
    text += fmt::format(R"(  {{ id = "{}", node = {}, display = ":0")", window_id(wall, screen),
                        toml_quote(wall.hosts[owners[screen]]));
    // Beyond the largest X screen nobody can say where it stands.
    const std::int64_t x = std::int64_t{beside} * pixels.width;
    if (x + pixels.width <= kMaxDesktopSide) {
      text += fmt::format(", rect = [{}, 0, {}, {}], fullscreen = true", x, pixels.width, pixels.height);
    }
    text += " },\n";
  }
  return text + "]\n";
}

/// `windows = [...]` of the grid, a line per row of screens.
std::string windows_of_grid(const WallTemplate& wall) {
  std::string text = "windows = [\n";
  for (int row = 0; row < wall.rows; ++row) {
    text += "  ";
    for (int column = 0; column < wall.columns; ++column) {
      const int index = row * wall.columns + column;
      const auto screen = static_cast<std::size_t>(index);
      text += fmt::format("\"{}\",{}", window_id(wall, screen), column + 1 < wall.columns ? " " : "\n");
    }
  }
  return text + "]\n";
}

[[noreturn]] void refuse(std::string_view list, std::string_view why) {
  throw Error(ExitCode::Usage, fmt::format("'{}' is no list of hosts: {}", printable(list), why),
              "write e.g. wall0[1-9] or a[01-03,07],b2");
}

/// Splits at the commas that stand outside of brackets.
std::vector<std::string_view> words_of(std::string_view list) {
  std::vector<std::string_view> words;
  std::size_t begin = 0;
  bool inside = false;
  for (std::size_t i = 0; i <= list.size(); ++i) {
    const char c = i < list.size() ? list[i] : ',';
    if (c == '[' && inside) refuse(list, "a bracket opens inside another");
    if (c == ']' && !inside) refuse(list, "a bracket closes that never opened");
    inside = c == '[' || (inside && c != ']');
    if (c != ',' || (inside && i < list.size())) continue;
    if (inside) refuse(list, "a bracket never closes");
    if (i == begin) refuse(list, "a name is missing");
    words.push_back(list.substr(begin, i - begin));
    begin = i + 1;
  }
  return words;
}

int number_of(std::string_view digits, std::string_view list) {
  int number = 0;
  const auto [end, failed] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  const bool plain = !digits.empty() && digits.front() >= '0' && digits.front() <= '9';
  if (!plain || failed != std::errc() || end != digits.data() + digits.size()) {
    refuse(list, fmt::format("'{}' is no number", printable(digits)));
  }
  return number;
}

void check_count(std::size_t count, std::string_view list) {
  if (count <= static_cast<std::size_t>(kMaxScreens)) return;
  refuse(list, fmt::format("it has more than {} hosts", kMaxScreens));
}

/// What a bracket's text "01-03,07" stands for.
std::vector<std::string> numbers_of(std::string_view text, std::string_view list) {
  std::vector<std::string> numbers;
  while (true) {
    const std::size_t comma = text.find(',');
    const std::string_view range = text.substr(0, comma);
    const std::size_t dash = range.find('-');
    const std::string_view low = range.substr(0, dash);
    const std::string_view high = dash == std::string_view::npos ? low : range.substr(dash + 1);
    const int first = number_of(low, list);
    const int last = number_of(high, list);
    if (last < first) refuse(list, fmt::format("the range {} runs backwards", range));
    const bool padded = low.size() > 1 && low.front() == '0';
    if (padded && high.size() < low.size()) refuse(list, fmt::format("the range {} has ends of other widths", range));
    check_count(static_cast<std::size_t>(last - first), list);
    for (int number = first; number <= last; ++number) {
      numbers.push_back(fmt::format("{:0{}}", number, padded ? low.size() : 1));
    }
    check_count(numbers.size(), list);
    if (comma == std::string_view::npos) return numbers;
    text.remove_prefix(comma + 1);
  }
}

std::vector<std::string> expand(std::string_view word, std::string_view list) {
  std::vector<std::string> names{""};
  while (!word.empty()) {
    const std::size_t bracket = word.find('[');
    for (std::string& name : names) name += word.substr(0, bracket);
    if (bracket == std::string_view::npos) break;
    const std::size_t end = word.find(']');
    const std::vector<std::string> numbers = numbers_of(word.substr(bracket + 1, end - bracket - 1), list);
    check_count(names.size() * numbers.size(), list);
    std::vector<std::string> longer;
    for (const std::string& name : names) {
      for (const std::string& number : numbers) longer.push_back(name + number);
    }
    names = std::move(longer);
    word.remove_prefix(end + 1);
  }
  return names;
}

}  // namespace

std::string write_wall_template(const WallTemplate& wall) {
  const Numbers numbers = numbers_of(wall);
  check(wall, numbers);
  const bool here = wall.hosts.empty();
  std::string text = fmt::format("# {} x {} screens", wall.columns, wall.rows);
  text += here ? " on this machine.\n"
               : fmt::format(" on {} host{}, row by row from the top left.\n", wall.hosts.size(),
                             wall.hosts.size() == 1 ? "" : "s");
  if (!wall.command.empty()) text += fmt::format("# Made by: {}\n", printable(wall.command, 400));
  text +=
      "# After a change: hpr wall check FILE; hpr wall plan FILE -o wall.svg draws it, hpr wall pattern FILE -o DIR "
      "tests it.\n"
      "hpr_wall = 1\n";
  text += fmt::format("name = \"{}x{} wall\"\n", wall.columns, wall.rows);
  if (!here) text += tables_of_hosts(wall, numbers.pixels);
  text += "\n[[surfaces]]\nid = \"wall\"\n\n[surfaces.grid]\n";
  text += fmt::format("columns = {}\nrows = {}\n", wall.columns, wall.rows);
  text += fmt::format("tile_pixels = [{}, {}]\n", numbers.pixels.width, numbers.pixels.height);
  if (!numbers.measured)
    text += "# Guesses where they were not told: measure the lit area of a panel, and the gap between two.\n";
  text += fmt::format("tile_size_m = [{}, {}]  # lit area of a panel, width and height\n",
                      toml_number(numbers.size_m.x), toml_number(numbers.size_m.y));
  text += fmt::format("gap_m = [{}, {}]  # lit edge to lit edge, between columns and between rows\n",
                      toml_number(numbers.gap_m.x), toml_number(numbers.gap_m.y));
  text += "centre_m = [0.0, 0.0, 0.0]  # of the wall; y is up\n";
  if (!here) text += windows_of_grid(wall);
  text +=
      "# rotate = 90  # where all panels are mounted turned: clockwise turn of what they are sent\n"
      "\n"
      "# Without a viewer the wall shows what the scene's camera sees. With one it is a window into the scene: eyes "
      "at\n"
      "# position_m, the wall around centre_m, both in metres.\n"
      "# [[viewers]]\n"
      "# id = \"eye\"\n";
  return text + fmt::format("# position_m = [0.0, 0.0, {}]\n",
                            toml_number(to_tenths_of_mm(1.5 * wall.columns * numbers.size_m.x)));
}

std::vector<std::string> parse_host_list(std::string_view text) {
  std::vector<std::string> hosts;
  std::set<std::string> seen;
  for (const std::string_view word : words_of(text)) {
    for (std::string& host : expand(word, text)) {
      // A host's name is its node's id, too.
      if (!is_id(host)) refuse(text, fmt::format("'{}' cannot be a host's name", printable(host)));
      if (!seen.insert(host).second) refuse(text, fmt::format("it names '{}' twice", host));
      hosts.push_back(std::move(host));
    }
    check_count(hosts.size(), text);
  }
  return hosts;
}

}  // namespace hpr
