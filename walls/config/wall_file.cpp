#include "walls/config/wall_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "core/bytes.h"
#include "core/error.h"
#include "core/file.h"
#include "core/log.h"
#include "core/text.h"
#include "walls/config/wall_draft.h"
#include "walls/config/wall_keys.h"
#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

constexpr std::string_view kForm = "write PATH=VALUE, e.g. viewers.0.position_m=[0,1.6,0.5] or stereo.mode=anaglyph";

void set_position(TomlValue& value, TextPosition position) {
  value.position = position;
  for (TomlValue& item : value.items) set_position(item, position);
  for (TomlEntry& entry : value.entries) {
    entry.position = position;
    set_position(entry.value, position);
  }
}

/// None when the text is neither TOML nor a bare word.
std::optional<TomlValue> value_of(std::string_view text) {
  auto parsed = parse_toml(fmt::format("v = {}", text));
  if (auto* const table = std::get_if<TomlValue>(&parsed)) {
    if (table->entries.size() == 1) return std::move(table->entries.front().value);
    return std::nullopt;
  }
  const bool bare = !text.empty() && std::ranges::all_of(text, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string_view("-_./:").find(c) != std::string_view::npos;
  });
  if (!bare) return std::nullopt;
  TomlValue word;
  word.type = TomlValue::Type::Text;
  word.text = std::string(text);
  return word;
}

std::vector<std::string> steps_of(std::string_view path) {
  std::vector<std::string> steps;
  while (true) {
    const std::size_t dot = path.find('.');
    steps.emplace_back(path.substr(0, dot));
    if (dot == std::string_view::npos) return steps;
    path.remove_prefix(dot + 1);
  }
}

std::optional<std::size_t> index_of(const std::string& step) {
  std::size_t index = 0;
  const auto [stop, error] = std::from_chars(step.data(), step.data() + step.size(), index);
  if (error != std::errc() || stop != step.data() + step.size()) return std::nullopt;
  return index;
}

/// Goes from a value to the one a step below; what is missing is made.
class Walker {
 public:
  Walker(TomlValue& document, TextPosition position, Findings& findings)
      : value_(&document), position_(position), findings_(findings) {}

  /// False, and a finding, where there is no such step.
  bool step(const std::string& name) {
    const auto index = index_of(name);
    if (fresh_) value_->type = index ? TomlValue::Type::Array : TomlValue::Type::Table;
    if (value_->type == TomlValue::Type::Array) return index ? into_array(*index) : refuse(name, "takes a number");
    if (value_->type == TomlValue::Type::Table) return into_table(name);
    return refuse(name, fmt::format("is inside {}", describe(value_->type)));
  }

  void put(TomlValue value) {
    set_position(value, position_);
    *value_ = std::move(value);
  }

 private:
  [[nodiscard]] TomlValue made() const {
    TomlValue value;
    value.position = position_;
    return value;
  }

  bool into_array(std::size_t index) {
    if (index > value_->items.size()) {
      return refuse(std::to_string(index), fmt::format("is beyond the {} there are", value_->items.size()));
    }
    fresh_ = index == value_->items.size();
    if (fresh_) value_->items.push_back(made());
    value_ = &value_->items[index];
    return true;
  }

  bool into_table(const std::string& name) {
    const auto entry = std::ranges::find(value_->entries, name, &TomlEntry::key);
    fresh_ = entry == value_->entries.end();
    if (fresh_) {
      value_->entries.push_back({name, position_, made()});
      value_ = &value_->entries.back().value;
    } else {
      value_ = &entry->value;
    }
    return true;
  }

  bool refuse(const std::string& name, std::string_view why) {
    findings_.error(position_, fmt::format("'{}' of the path {}", printable(name), why), std::string(kForm));
    return false;
  }

  TomlValue* value_;
  TextPosition position_;
  Findings& findings_;
  bool fresh_ = false;  ///< value_ was made by the last step
};

/// The largest int for what is larger than that.
int to_number(std::string_view digits) {
  int number = 0;
  const auto result = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  return result.ec == std::errc() && result.ptr == digits.data() + digits.size() ? number
                                                                                 : std::numeric_limits<int>::max();
}

bool all_digits(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
}

/// The two numbers of "6x3", as to_number has them. None when the text is no such pair.
std::optional<std::pair<int, int>> pair_of(std::string_view text) {
  const std::size_t x = text.find('x');
  if (x == std::string_view::npos) return std::nullopt;
  const std::string_view a = text.substr(0, x);
  const std::string_view b = text.substr(x + 1);
  if (!all_digits(a) || !all_digits(b)) return std::nullopt;
  return std::pair(to_number(a), to_number(b));
}

/// A file may hold more than is acted on; what is asked for on the command line must not be lost.
void refuse_without_effect(const std::string& override, Findings& findings) {
  const std::string section = override.substr(0, override.find_first_of(".="));
  const auto key = std::ranges::find(wall_keys().keys, section, &TableKey<Wall>::name);
  if (key == wall_keys().keys.end() || !key->kind.is_ignored) return;
  findings.error({}, fmt::format("--set {}: this version acts on nothing of '{}'", printable(override), section),
                 "hpr wall run has options for it: --strategy, --quality, --codec, --swap-timeout...");
}

/// Puts the values of overrides, as parse_wall() takes them, over those of a document; a path that leads nowhere is a
/// finding. Throws Error (Usage) for what is no override.
void apply_overrides(TomlValue& document, std::span<const std::string> overrides, Findings& findings) {
  for (std::size_t i = 0; i < overrides.size(); ++i) {
    const std::string_view text = overrides[i];
    const TextPosition position{0, 0, static_cast<int>(i) + 1};
    const std::size_t equals = text.find('=');
    const std::string_view path = text.substr(0, equals);
    auto value = equals == std::string_view::npos ? std::nullopt : value_of(text.substr(equals + 1));
    const std::vector<std::string> steps = steps_of(path);
    if (!value || std::ranges::any_of(steps, &std::string::empty)) {
      throw Error(ExitCode::Usage,
                  fmt::format("--set {}: {}", printable(text),
                              value ? "a key of the path is empty" : "the value is neither TOML nor a word"),
                  std::string(kForm));
    }
    Walker walker(document, position, findings);
    if (std::ranges::all_of(steps, [&](const std::string& step) { return walker.step(step); })) {
      walker.put(std::move(*value));
    }
  }
}

/// Fills in a wall whose screens are sound: the default viewer and the hash.
void finish_wall(Wall& wall) {
  if (!wall.viewers.front().has_position) {
    const WallExtent extent = wall_extent(wall);
    wall.viewers.front().position = extent.centroid + extent.axes[2] * extent.height;
  }
  Wall nameless = wall;
  nameless.name.clear();
  for (WallScreen& screen : nameless.screens) {
    for (WarpFile* const file : {&screen.warp.mesh, &screen.warp.blend, &screen.warp.black}) {
      if (!file->path.empty()) file->path = hex16(file->content);
    }
  }
  const std::string text = expand_wall(nameless);
  wall.hash = xxh64(std::as_bytes(std::span(text)));
}

}  // namespace

bool WallReading::ok() const {
  return std::ranges::none_of(findings, &WallFinding::error);
}

WallReading parse_wall(std::string_view text, const std::string& name, const std::vector<std::string>& overrides,
                       WallText kind) {
  Findings findings(name, text, overrides, kind);
  WallReading reading;
  auto parsed = parse_toml(text);
  if (const auto* const failure = std::get_if<TomlFailure>(&parsed)) {
    findings.error(failure->position, failure->what, "wall files are TOML 1.0; inline tables stand on one line");
    reading.findings = findings.take();
    return reading;
  }
  Wall& wall = reading.wall;
  WallDraft draft;
  const std::filesystem::path folder = std::filesystem::path(name).parent_path();
  apply_overrides(std::get<TomlValue>(parsed), overrides, findings);
  TableReader document(std::get<TomlValue>(parsed), "the wall", findings);
  wall.name = std::filesystem::path(name).stem().string();
  read_document(document, folder, draft, wall);
  for (const std::string& override : overrides) refuse_without_effect(override, findings);
  if (link_wall(draft, findings)) {
    link_viewers(draft, findings);
    check_position_maps(draft, findings);
  }
  if (!findings.any_errors()) {
    warn_about_viewers(draft, findings);
    warn_about_neighbors(draft, findings);
  }

  const bool sound = !findings.any_errors();
  reading.findings = findings.take();
  if (!sound) return reading;
  for (DraftNode& node : draft.nodes) wall.nodes.push_back(std::move(node.node));
  for (DraftWindow& window : draft.windows) wall.windows.push_back(std::move(window.window));
  for (DraftScreen& screen : draft.screens) wall.screens.push_back(std::move(screen.screen));
  for (DraftMonitor& monitor : draft.monitors) wall.monitors.push_back(std::move(monitor.monitor));
  if (!draft.viewers.empty()) wall.viewers.clear();
  for (DraftViewer& viewer : draft.viewers) wall.viewers.push_back(std::move(viewer.viewer));
  finish_wall(wall);
  return reading;
}

std::optional<Wall> wall_from_shorthand(std::string_view spec) {
  constexpr double kTileHeight = 0.36;
  constexpr double kGap = 0.006;
  const std::size_t at = spec.find('@');
  const auto grid_size = pair_of(spec.substr(0, at));
  const auto pixels = at == std::string_view::npos ? std::pair(640, 360) : pair_of(spec.substr(at + 1));
  if (!grid_size || !pixels) return std::nullopt;
  const auto [columns, rows] = *grid_size;
  const bool none = columns < 1 || rows < 1;
  if (none || columns > kMaxScreens || rows > kMaxScreens || columns * rows > kMaxScreens) {
    throw Error(none ? ExitCode::Usage : ExitCode::Limit,
                fmt::format("wall '{}' has an impossible number of screens", printable(spec)),
                fmt::format("columns times rows must be from 1 to {}", kMaxScreens));
  }
  const Size size{pixels->first, pixels->second};
  const bool empty = size.width < 1 || size.height < 1;
  if (empty || size.width > kMaxScreenSide || size.height > kMaxScreenSide) {
    throw Error(empty ? ExitCode::Usage : ExitCode::Limit,
                fmt::format("wall '{}' has screens of an impossible size", printable(spec)),
                fmt::format("sides must be from 1 to {} pixels", kMaxScreenSide));
  }
  WallGrid grid;
  grid.columns = columns;
  grid.rows = rows;
  grid.tile_pixels = size;
  grid.tile_height_m = kTileHeight;
  grid.tile_width_m = kTileHeight * size.width / size.height;
  grid.column_gaps_m.assign(static_cast<std::size_t>(columns - 1), kGap);
  grid.row_gaps_m.assign(static_cast<std::size_t>(rows - 1), kGap);
  Wall wall;
  wall.name = std::string(spec);
  wall.screens = expand_grid(grid, "wall");
  finish_wall(wall);
  return wall;
}

WallReading read_wall(const std::string& spec, const std::vector<std::string>& overrides) {
  constexpr std::uint64_t kMaxFileBytes = std::uint64_t{16} << 20;
  if (auto wall = wall_from_shorthand(spec)) {
    if (overrides.empty()) return {std::move(*wall), {}};
    return parse_wall(expand_wall(*wall), spec, overrides, WallText::Expansion);
  }
  std::error_code error;
  if (!std::filesystem::exists(spec, error)) {
    throw Error(ExitCode::Io, fmt::format("there is no wall file '{}'", printable(spec)),
                "a wall is a TOML file, or columns x rows such as 3x2 or 3x2@1920x1080");
  }
  const std::vector<std::byte> bytes = read_file(spec, kMaxFileBytes);
  return parse_wall({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, spec, overrides);
}

Wall load_wall(const std::string& spec, const std::vector<std::string>& overrides, bool logs_warnings) {
  WallReading reading = read_wall(spec, overrides);
  const auto first = std::ranges::find_if(reading.findings, &WallFinding::error);
  if (first != reading.findings.end()) throw Error(ExitCode::BadInput, first->what, first->hint, first->line);
  if (!logs_warnings) return std::move(reading.wall);
  for (const WallFinding& finding : reading.findings) log::warning("{} ({})", finding.what, finding.hint);
  return std::move(reading.wall);
}

}  // namespace hpr
