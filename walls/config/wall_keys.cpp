#include "walls/config/wall_keys.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <ranges>

#include "core/error.h"
#include "core/text.h"
#include "walls/config/wall_file.h"
#include "walls/tracking/head_path.h"

namespace hpr {
namespace {

using namespace keys;

constexpr int kMaxRanks = 1 << 20;

/// Version 1 of the format.
KeyKind<Wall> version() {
  const auto read = [](const KeySource& source, Wall& /*into*/) {
    const TomlValue* const value = source.reader.find(source.key);
    if (value == nullptr || (value->type == TomlValue::Type::Integer && value->integer == 1)) return;
    source.reader.error(source.key, "is not 1", "this program reads version 1 of wall files: hpr_wall = 1");
  };
  return {.takes = "1", .schema = {{"const", 1}}, .read = read, .write = [](const Wall&) { return std::string("1"); }};
}

struct NodeGpu {
  std::string id;
};

const KeyTable<NodeGpu>& gpu_keys() {
  static const KeyTable<NodeGpu> table{"gpu",
                                       {{"id", always(id(&NodeGpu::id)), "for windows to name it", "\"g0\""},
                                        {"backend", ignored<NodeGpu>(), ""},
                                        {"egl_device", ignored<NodeGpu>(), ""},
                                        {"cpu_affinity", ignored<NodeGpu>(), ""}}};
  return table;
}

KeyKind<WallNode> gpus() {
  const auto read = [](const KeySource& source, WallNode& into) {
    for (const TomlValue* const value : source.reader.tables(source.key)) {
      TableReader reader(*value, std::string(gpu_keys().name), source.reader.findings());
      NodeGpu gpu;
      read_keys(gpu_keys(), reader, source.folder, gpu);
      if (!gpu.id.empty()) into.gpus.push_back(std::move(gpu.id));
    }
  };
  const auto write = [](const WallNode& from) {
    std::string text;
    for (const std::string& gpu : from.gpus) {
      text += fmt::format("{}{}", text.empty() ? "" : ", ", write_inline(gpu_keys(), NodeGpu{gpu}));
    }
    return fmt::format("[{}]", text);
  };
  return {.takes = "tables",
          .schema = schema::list(schema_of(gpu_keys())),
          .read = read,
          .write = write,
          .is_initial = [](const WallNode& from) { return from.gpus.empty(); },
          .inner = describe(gpu_keys(), "[]")};
}

/// By how much a panel is mounted turned.
KeyKind<WallScreen> quarter_turn() {
  const auto read = [](TableReader& reader, std::string_view key) -> std::optional<int> {
    const auto degrees = reader.integer(key, 0, 270);
    if (!degrees || *degrees % 90 == 0) return degrees;
    reader.error(key, fmt::format("is {}", *degrees), "a panel is turned by 0, 90, 180 or 270 degrees");
    return std::nullopt;
  };
  return value_kind(&WallScreen::rotate, "0, 90, 180 or 270", {{"enum", Json::array({0, 90, 180, 270})}}, read);
}

/// One number for all three channels, or [red, green, blue]; each from `low` to `high`.
KeyKind<PanelColor> channels(glm::dvec3 PanelColor::*member, double low, double high) {
  const auto read = [=](TableReader& reader, std::string_view key) -> std::optional<glm::dvec3> {
    const TomlValue* const value = reader.find(key);
    if (value == nullptr) return std::nullopt;
    const bool one = value->type == TomlValue::Type::Integer || value->type == TomlValue::Type::Real;
    const auto numbers = one ? std::optional(glm::dvec3(value->real)) : reader.point(key);
    if (!numbers) return std::nullopt;
    for (int i = 0; i < 3; ++i) {
      if ((*numbers)[i] >= low && (*numbers)[i] <= high) continue;
      reader.error(key, fmt::format("holds {}", (*numbers)[i]),
                   fmt::format("one number, or [red, green, blue], each from {} to {}", low, high));
      return std::nullopt;
    }
    return numbers;
  };
  const Json one = schema::number(low, high);
  return always(value_kind(member, fmt::format("a number or [r, g, b], each {} to {}", low, high),
                           {{"anyOf", Json::array({one, schema::list(one, 3)})}}, read));
}

const KeyTable<PanelColor>& color_keys() {
  static const KeyTable<PanelColor> table{
      "colour",
      {{"gamma", channels(&PanelColor::gamma, 0.05, 20.0), "of its sRGB level the panel is sent the power 1 / gamma"},
       {"gain", channels(&PanelColor::gain, 0.0, 20.0),
        "in linear light the panel is sent black + (1 - black) gain light"},
       {"black", channels(&PanelColor::black, 0.0, 1.0), "see `gain`"}}};
  return table;
}

const KeyTable<EdgeBlend>& blend_keys() {
  const auto by_width = [](const EdgeBlend& blend) { return !blend.automatic; };
  const auto width = [&](double EdgeBlend::*member) { return when(by_width, number(member, 0.0, kMaxMeters)); };
  static const KeyTable<EdgeBlend> table{
      "edge_blend_m",
      {{"auto", boolean(&EdgeBlend::automatic), "fade what overlaps"},
       {"left", width(&EdgeBlend::left), "width, in metres"},
       {"right", width(&EdgeBlend::right), "width, in metres"},
       {"bottom", width(&EdgeBlend::bottom), "width, in metres"},
       {"top", width(&EdgeBlend::top), "width, in metres"},
       {"gamma", always(positive(&EdgeBlend::gamma, 20.0)), "power of the ramp; 1: straight in linear light"}}};
  return table;
}

/// "auto", a width for all sides, or a table.
KeyKind<WallScreen> edge_blend() {
  const auto read = [](const KeySource& source, WallScreen& into) {
    const auto& [reader, key, folder] = source;
    EdgeBlend& blend = into.blend;
    const TomlValue* const value = reader.find(key);
    if (value == nullptr) return;
    if (value->type == TomlValue::Type::Text) {
      blend.automatic = value->text == "auto";
      if (blend.automatic) return;
      reader.error(key, fmt::format("is \"{}\"", printable(value->text)),
                   "write \"auto\", or { left = 0.1, right = 0.1, top = 0.0, bottom = 0.0 } in metres");
      return;
    }
    if (value->type != TomlValue::Type::Table) {
      blend.left = blend.right = blend.bottom = blend.top = reader.real(key, 0.0, kMaxMeters).value_or(0.0);
      return;
    }
    TableReader sides(*value, std::string(blend_keys().name), reader.findings());
    read_keys(blend_keys(), sides, folder, blend);
    const std::array<std::pair<std::string_view, double>, 4> widths{
        {{"left", blend.left}, {"right", blend.right}, {"bottom", blend.bottom}, {"top", blend.top}}};
    for (const auto& [side, width] : widths) {
      if (!blend.automatic || !(width > 0.0)) continue;
      sides.error(side, "stands beside auto", "either auto = true, or the width of each side");
    }
  };
  const Json all_sides = schema::positive(kMaxMeters);
  return {.takes = "\"auto\", one width in metres, or a table",
          .schema = {{"anyOf", Json::array({{{"const", "auto"}}, all_sides, schema_of(blend_keys())})}},
          .read = read,
          .write = [](const WallScreen& from) { return write_inline(blend_keys(), from.blend); },
          .is_initial = [](const WallScreen& from) { return !from.blend.any(); },
          .inner = describe(blend_keys(), "")};
}

/// What a panel is sent besides the picture: of a screen, and of all tiles of a grid.
std::vector<TableKey<WallScreen>> panel_keys() {
  return {{"rotate", quarter_turn(), "degrees by which what is sent is turned clockwise"},
          {"mirror", choice(&WallScreen::mirror, mirror_names()),
           "sides that swap, after turning: for projection from behind"},
          {"eye", choice(&WallScreen::eye, eye_names()), "whose output this is"},
          {"colour", table(&WallScreen::color, color_keys()), "what makes panels look alike"},
          {"edge_blend_m", edge_blend(),
           "edges fade where screens of a plane overlap, with widths also those of a screen that overlaps none"}};
}

KeyTable<WallScreen> corner_keys() {
  const std::string_view example = "[x, y, z]";
  return {"corners_m",
          {{"ll", always(point(&WallScreen::lower_left)), "lower left, in metres", example},
           {"lr", always(point(&WallScreen::lower_right)), "lower right", example},
           {"ul", always(point(&WallScreen::upper_left)), "upper left", example}}};
}

/// The name of a file that belongs to a warp.
KeyKind<ScreenWarp> warp_file(WarpFile ScreenWarp::*member) {
  KeyKind<ScreenWarp> kind = read_elsewhere<ScreenWarp>("a file", {{"type", "string"}, {"minLength", 1}});
  kind.write = [=](const ScreenWarp& from) { return to_toml((from.*member).path); };
  kind.is_initial = [=](const ScreenWarp& from) { return (from.*member).path.empty(); };
  return kind;
}

KeyKind<WallScreen> warp() {
  const auto read = [](const KeySource& source, WallScreen& into) { read_warp(source.reader, source.folder, into); };
  return {.takes = "a table",
          .schema = schema_of(warp_keys()),
          .read = read,
          .write = [](const WallScreen& from) { return write_inline(warp_keys(), from.warp); },
          .is_initial = [](const WallScreen& from) { return !from.warp.any(); },
          .inner = describe(warp_keys(), "")};
}

/// Two lengths in metres.
KeyKind<DraftGrid> lengths(std::optional<std::vector<double>> DraftGrid::*member, std::string takes, Json schema) {
  const auto read = [](TableReader& reader, std::string_view key) { return reader.reals(key, 2, kMaxMeters); };
  return value_kind(member, std::move(takes), std::move(schema), read);
}

/// Gaps one by one, of which there are `count` of a countable grid.
template <typename Count>
KeyKind<DraftGrid> gaps(std::optional<std::vector<double>> DraftGrid::*member, Count count) {
  const auto read = [=](const KeySource& source, DraftGrid& into) {
    const bool readable = source.reader.has(source.key) && into.is_countable() && into.is_sized();
    if (readable) into.*member = source.reader.reals(source.key, static_cast<std::size_t>(count(into) - 1), kMaxMeters);
  };
  return {.takes = "metres", .schema = schema::list(schema::number(-kMaxMeters, kMaxMeters)), .read = read};
}

/// The other name of `rotate`.
KeyKind<DraftGrid> panel_rotate() {
  KeyKind<DraftGrid> kind = lifted(&DraftGrid::tile, TableKey<WallScreen>{"", quarter_turn(), ""}).kind;
  kind.read = [turn = quarter_turn()](const KeySource& source, DraftGrid& into) {
    if (!source.reader.has(source.key)) return;
    if (source.reader.has("rotate")) {
      source.reader.error(source.key, "stands beside rotate", "they mean the same: remove one");
    }
    turn.read(source, into.tile);
  };
  kind.initial.clear();
  return kind;
}

KeyTable<DraftGrid> curve_keys() {
  return {"curve",
          {{"radius_m", positive(&DraftGrid::radius_m, kMaxMeters), "of the arc"},
           {"angle_degrees", positive(&DraftGrid::angle_degrees, 360.0), "between the outer edges"}},
          "oneOf",
          {"radius_m", "angle_degrees"}};
}

/// What a tracker of this type has.
KeyTable<WallTracker> tracker_keys(const char* type, std::vector<TableKey<WallTracker>> further) {
  KeyKind<WallTracker> kind = read_elsewhere<WallTracker>(fmt::format("\"{}\"", type), {{"const", type}});
  kind.write = [=](const WallTracker&) { return toml_quote(type); };
  KeyTable<WallTracker> table{"tracker", {{"type", std::move(kind), "", "\"file\""}}};
  std::ranges::move(further, std::back_inserter(table.keys));
  table.keys.push_back({"sensor", ignored<WallTracker>(), ""});
  table.keys.push_back({"predict_ms", ignored<WallTracker>(), ""});
  return table;
}

KeyTable<WallTracker> recording_keys() {
  const KeyKind<WallTracker> path{
      .takes = "a file", .schema = schema::text(), .read = read_head_recording, .write = [](const WallTracker& from) {
        return to_toml(from.path);
      }};
  return tracker_keys("file",
                      {{"path", path, "of the recording", "\"walk.csv\""},
                       {"rate_hz", always(positive(&WallTracker::rate_hz, 1e6)), "frames per second of its time"}});
}

KeyTable<WallTracker> lost_keys() {
  static const std::vector<std::string> choices{"freeze", "rest"};
  return {"lost",
          {{"after_ms", always(whole(&WallTracker::lost_after_ms, 1, 3'600'000)), "milliseconds without a datagram"},
           {"then", always(choice(&WallTracker::lost_then, choices)), "the head stays, or goes to `position_m`"}}};
}

KeyTable<WallTracker> udp_keys() {
  return tracker_keys("udp", {{"address", always(text(&WallTracker::address)), "of this host; `0.0.0.0`: all"},
                              {"port", always(whole(&WallTracker::port, 1, 65535)), "listened at by rank 0", "5005"},
                              {"lost", always(section(lost_keys())), "what to do without datagrams"}});
}

KeyTable<WallTracker> vrpn_keys() {
  KeyTable<WallTracker> table =
      tracker_keys("vrpn", {{"address", ignored<WallTracker>(), ""}, {"lost", ignored<WallTracker>(), ""}});
  table.keys.front().kind.read = ignored<WallTracker>().read;
  return table;
}

/// A table whose keys depend on its `type`.
KeyKind<WallViewer> tracker() {
  static const std::array<KeyTable<WallTracker>, 3> tables{recording_keys(), udp_keys(), vrpn_keys()};
  static const std::vector<std::string> types{"file", "udp", "vrpn"};
  const auto read = [](const KeySource& source, WallViewer& into) {
    const TomlValue* const value = source.reader.table(source.key);
    if (value == nullptr) return;
    TableReader reader(*value, std::string(tables[0].name), source.reader.findings());
    const auto type = reader.choice("type", types);
    if (type == 1U) into.tracker.kind = WallTracker::Kind::Udp;
    if (type) return read_keys(tables.at(*type), reader, source.folder, into.tracker);
    reader.require("type", "\"file\"");
    for (const KeyTable<WallTracker>& keys : tables) {
      for (const TableKey<WallTracker>& key : keys.keys) static_cast<void>(reader.has(key.name));
    }
    reader.finish();
  };
  KeyKind<WallViewer> kind{
      .takes = "a table",
      .schema = {},
      .read = read,
      .write =
          [](const WallViewer& from) {
            return write_inline(tables[from.tracker.kind == WallTracker::Kind::File ? 0 : 1], from.tracker);
          },
      .is_initial = [](const WallViewer& from) { return from.tracker.kind == WallTracker::Kind::None; }};
  for (std::size_t i = 0; i < tables.size(); ++i) {
    kind.schema["oneOf"].push_back(schema_of(tables[i]));
    std::ranges::move(describe(tables[i], fmt::format(" ({})", types[i])), std::back_inserter(kind.inner));
  }
  return kind;
}

KeyKind<WallViewer> position() {
  KeyKind<WallViewer> kind = point(&WallViewer::position);
  kind.read = [](const KeySource& source, WallViewer& into) {
    const auto position = source.reader.point(source.key);
    into.has_position = position.has_value();
    into.position = position.value_or(into.position);
  };
  kind.initial.clear();
  return when([](const WallViewer& viewer) { return viewer.has_position; }, std::move(kind));
}

/// A monitor's size by the place it has elsewhere.
KeyKind<WallMonitor> monitor_rect() {
  const auto read = [](const KeySource& source, WallMonitor& into) {
    if (const auto rect = source.reader.rect(source.key)) into.pixels = {rect->width(), rect->height()};
  };
  return {.takes = "[x, y, width, height]", .schema = rect_schema(), .read = read};
}

/// The surfaces with their screens, which stand together.
std::string surface_blocks(const Wall& wall) {
  std::string text;
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    const WallScreen& screen = wall.screens[i];
    const bool first = i == 0 || wall.screens[i - 1].surface != screen.surface;
    const bool last = i + 1 == wall.screens.size() || wall.screens[i + 1].surface != screen.surface;
    if (first) {
      DraftSurface surface{.id = screen.surface};
      if (screen.viewer > 0) surface.viewer = wall.viewers.at(screen.viewer).id;
      text += "\n[[surfaces]]\n" + write_keys(surface_keys(), surface, "", "\n") + "screens = [\n";
    }
    text += "  " + write_inline(screen_keys(), screen) + ",\n";
    if (last) text += "]\n";
  }
  return text;
}

KeyKind<Wall> surfaces() {
  KeyKind<Wall> kind =
      read_elsewhere<Wall>("tables", schema::list(schema_of(surface_keys())), describe(surface_keys(), "[]"));
  kind.write_blocks = surface_blocks;
  return kind;
}

KeyKind<Wall> viewers() {
  KeyKind<Wall> kind =
      read_elsewhere<Wall>("tables", schema::list(schema_of(viewer_keys())), describe(viewer_keys(), "[]"));
  kind.write_blocks = [](const Wall& from) {
    std::string text;
    for (const WallViewer& viewer : from.viewers) {
      text += "\n[[viewers]]\n" + write_keys(viewer_keys(), viewer, "", "\n");
    }
    return text;
  };
  return kind;
}

KeyTable<Wall> stereo_keys() {
  return {"stereo", {{"mode", choice(&Wall::stereo, stereo_names()), "how screens for both eyes carry two pictures"}}};
}

KeyTable<Wall> test_keys() {
  return {"test",
          {{"gap_rgba", always(color(&Wall::gap_color)), "paints what lies between screens in `wall.png`"},
           {"viewer_path", read_elsewhere<Wall>("a file", schema::text()), "a recorded path for the first viewer"},
           {"headless", ignored<Wall>(), ""},
           {"scale", ignored<Wall>(), ""},
           {"dump", ignored<Wall>(), ""}}};
}

KeyKind<Wall> test_section() {
  KeyKind<Wall> kind = section(test_keys());
  kind.write = nullptr;
  kind.write_blocks = [](const Wall& from) { return "\n[test]\n" + write_keys(test_keys(), from, "", "\n"); };
  return kind;
}

}  // namespace

const KeyTable<Wall>& wall_keys() {
  static const KeyTable<Wall> table{
      "the wall",
      {{"hpr_wall", version(), "the version of this format", "1"},
       {"name", always(text(&Wall::name)), "for titles", "", "the file's name"},
       {"nodes", lines(&Wall::nodes, node_keys()), "hosts that drive windows, or only render"},
       {"windows", lines(&Wall::windows, window_keys()), "places on displays in which screens are shown"},
       {"surfaces", surfaces(), "screens that are seen as one picture", "[{ id = \"wall\", grid = { ... } }]"},
       {"viewers", viewers(), "who looks"},
       {"stereo", section(stereo_keys()), "two eyes' pictures"},
       {"test", test_section(), "for trying a wall"},
       {"monitors", lines(&Wall::monitors, monitor_keys()), "operators' copies"},
       {"sync", ignored<Wall>(), ""},
       {"render", ignored<Wall>(), ""},
       {"transport", ignored<Wall>(), ""},
       {"fault", ignored<Wall>(), ""}}};
  return table;
}

const KeyTable<WallNode>& node_keys() {
  static const KeyTable<WallNode> table{
      "node",
      {{"id", always(id(&WallNode::id)), "for windows to name it", "\"n0\""},
       {"host", always(text(&WallNode::host)), "as MPI names it; `localhost` and `*` are any", "", "\"localhost\""},
       {"ranks", whole(&WallNode::ranks, 1, kMaxRanks), "how many are to run there", "", "any number"},
       {"gpus", gpus(), "of the host"},
       {"nic", ignored<WallNode>(), ""}}};
  return table;
}

const KeyTable<WallWindow>& window_keys() {
  static const KeyTable<WallWindow> table{
      "window",
      {{"id", always(id(&WallWindow::id)), "for screens to name it", "\"w0\""},
       {"node", text(&WallWindow::node, "a node's id"), "whose host it is on", "", "the host its rank runs on"},
       {"gpu", text(&WallWindow::gpu, "a gpu's id"), "of the node", "", "any"},
       {"rank", whole(&WallWindow::rank, 0, kMaxRanks - 1), "that must own it", "", "any"},
       {"display", text(&WallWindow::display, "an X display"), "where it opens", "", "`DISPLAY`"},
       {"monitor", text(&WallWindow::monitor), "by name, as xrandr has it", "", "the one most of `rect` is on"},
       {"rect", rect(&WallWindow::rect), "on the display", "", "as large as its screens"},
       {"fullscreen", boolean(&WallWindow::fullscreen), "covers the whole monitor"},
       {"swap_group", ignored<WallWindow>(), ""}}};
  return table;
}

const KeyTable<DraftSurface>& surface_keys() {
  static const KeyTable<DraftSurface> table{
      "surface",
      {{"id", always(id(&DraftSurface::id)), "part of its screens' ids where it is a grid", "",
        "\"wall\"; required beside other surfaces"},
       {"viewer", text(&DraftSurface::viewer, "a viewer's id"), "who sees it", "", "the first"},
       {"grid", read_elsewhere<DraftSurface>("a table", schema_of(grid_keys()), describe(grid_keys(), "")),
        "equal screens; either this or `screens`"},
       {"screens",
        read_elsewhere<DraftSurface>("tables",
                                     {{"type", "array"}, {"items", schema_of(screen_keys())}, {"minItems", 1}},
                                     describe(screen_keys(), "[]")),
        "screens one by one"},
       {"mpcdi", ignored<DraftSurface>(), ""}},
      "oneOf",
      {"grid", "screens"}};
  return table;
}

const KeyTable<DraftGrid>& grid_keys() {
  static const KeyTable<DraftGrid> table = [] {
    const Json side = schema::number(kMinSide_m, kMaxMeters);
    const Json gap = schema::number(-kMaxMeters, kMaxMeters);
    KeyTable<DraftGrid> grid{
        "grid",
        {{"columns", whole(&DraftGrid::columns, 1, kMaxScreens), "of screens", "3"},
         {"rows", whole(&DraftGrid::rows, 1, kMaxScreens), "of screens", "2"},
         {"tile_pixels", size(&DraftGrid::tile_pixels, kMaxScreenSide), "of each upright picture", "[1920, 1080]"},
         {"tile_size_m", lengths(&DraftGrid::tile_size_m, "[width, height], in metres", schema::list(side, 2)),
          "lit area of each", "[1.2096, 0.6804]"},
         {"gap_m", lengths(&DraftGrid::gap_m, "[x, y], in metres", schema::list(gap, 2)),
          "between lit edges; negative: overlap", "", "[0, 0]"},
         {"centre_m", point(&DraftGrid::center), "of the grid, in metres"}},
        "not",
        {"rotate", "panel_rotate"}};
    for (const TableKey<WallScreen>& key : panel_keys()) {
      grid.keys.push_back(lifted(&DraftGrid::tile, key));
      if (key.name == "rotate") grid.keys.push_back({"panel_rotate", panel_rotate(), "another name of `rotate`"});
    }
    const auto columns = [](const DraftGrid& draft) { return *draft.columns; };
    const auto rows = [](const DraftGrid& draft) { return *draft.rows; };
    const auto windows = value_kind(&DraftGrid::windows, "windows' ids", schema::list(schema::text()),
                                    [](TableReader& reader, std::string_view key) { return reader.texts(key); });
    grid.keys.push_back(
        {"windows", windows, "one per screen, row by row from the top left", "", "one of its own each"});
    grid.keys.push_back({"column_gaps_m", gaps(&DraftGrid::column_gaps_m, columns), "one by one", "", "`gap_m`"});
    grid.keys.push_back({"row_gaps_m", gaps(&DraftGrid::row_gaps_m, rows), "one by one, from the top", "", "`gap_m`"});
    grid.keys.push_back(
        {"curve", section(curve_keys()),
         "columns stand as chords on an arc around a vertical axis before the centre, gaps along the arc", "",
         "a plane"});
    return grid;
  }();
  return table;
}

const KeyTable<WallScreen>& screen_keys() {
  static const KeyTable<WallScreen> table = [] {
    const auto has_window = [](const WallScreen& screen) { return !screen.window.empty(); };
    KeyTable<WallScreen> screen{
        "screen",
        {{"id", always(id(&WallScreen::id)), "unique, and a file's name", "\"left\""},
         {"pixels", always(size(&WallScreen::pixels, kMaxScreenSide)), "of the upright picture", "[1920, 1080]"},
         {"corners_m", always(section(corner_keys())), "of the lit area, at right angles to 1e-6",
          "{ ll = [x, y, z], lr = [x, y, z], ul = [x, y, z] }"},
         {"window", text(&WallScreen::window, "a window's id"), "in which it is shown", "", "one of its own"},
         {"viewport", when(has_window, rect(&WallScreen::viewport)), "of the window, after turning", "",
          "from its top left corner"}}};
    for (TableKey<WallScreen>& key : panel_keys()) screen.keys.push_back(std::move(key));
    screen.keys.push_back({"warp", warp(), "files of a calibration, see [Warped screens](#warped-screens)"});
    screen.keys.push_back({"overscan_px", ignored<WallScreen>(), ""});
    return screen;
  }();
  return table;
}

const KeyTable<ScreenWarp>& warp_keys() {
  static const KeyTable<ScreenWarp> table{
      "warp",
      {{"mesh", warp_file(&ScreenWarp::mesh), "where the picture goes"},
       {"blend", warp_file(&ScreenWarp::blend), "factors of linear light"},
       {"black", warp_file(&ScreenWarp::black), "linear light that is shown at least"}},
      "anyOf",
      {"mesh", "blend", "black"}};
  return table;
}

const KeyTable<WallViewer>& viewer_keys() {
  static const KeyTable<WallViewer> table{
      "viewer",
      {{"id", id(&WallViewer::id), "for surfaces to name it"},
       {"position_m", position(), "of the head", "", "the wall shows what the camera sees"},
       {"ipd_m", number(&WallViewer::ipd_m, 0.0, 10.0), "between the eyes"},
       {"eye_offset_m", point(&WallViewer::eye_offset), "from the head to between the eyes, in its own axes"},
       {"near_m", positive(&WallViewer::near_m, kMaxMeters), "distance of the near plane", "", "the camera's"},
       {"clamp_distance_m", always(positive(&WallViewer::clamp_distance_m, kMaxMeters)),
        "an eye nearer to a screen's plane is moved back to this distance"},
       {"tracker", tracker(), "where the head is while the wall runs"}}};
  return table;
}

const KeyTable<WallMonitor>& monitor_keys() {
  static const KeyTable<WallMonitor> table{
      "monitor",
      {{"id", always(id(&WallMonitor::id)), "unique among monitors and screens, and a file's name", "\"operator\""},
       {"surface", always(text(&WallMonitor::surface, "a surface's id")), "what it shows", "", "the only one"},
       {"rect", monitor_rect(), "its size is the monitor's; either this or `pixels`"},
       {"pixels", always(size(&WallMonitor::pixels, kMaxScreenSide)), "of the copy"},
       {"node", ignored<WallMonitor>(), ""},
       {"display", ignored<WallMonitor>(), ""},
       {"zoom", ignored<WallMonitor>(), ""}},
      "oneOf",
      {"rect", "pixels"}};
  return table;
}

void read_head_recording(const KeySource& source, WallTracker& tracker) {
  const auto path = source.reader.text(source.key);
  if (!path) return;
  tracker.kind = WallTracker::Kind::File;
  tracker.path = *path;
  tracker.file = (source.folder / *path).lexically_normal().string();
  try {
    static_cast<void>(load_head_path(tracker.file));
  } catch (const Error& error) {
    source.reader.error(source.key, fmt::format("cannot be used: {}", error.what()), error.hint());
  }
}

std::string expand_wall(const Wall& wall) {
  std::string text = write_keys(wall_keys(), wall, "", "\n");
  for (const TableKey<Wall>& key : wall_keys().keys) {
    if (key.kind.write_blocks) text += key.kind.write_blocks(wall);
  }
  return text;
}

std::string wall_schema() {
  Json document{{"$schema", "https://json-schema.org/draft/2020-12/schema"},
                {"title", "HPR wall file"},
                {"description", "The same data as a wall file's TOML; docs/walls.md says what the keys mean."}};
  const Json wall = schema_of(wall_keys());
  for (const auto& [key, value] : wall.members()) document[key] = value;
  return document.dump(2) + "\n";
}

std::string wall_keys_markdown() {
  const std::vector<KeyDescription> rows = describe(wall_keys(), "");
  std::vector<std::string> tables;
  for (const KeyDescription& row : rows) {
    if (std::ranges::find(tables, row.table) == tables.end()) tables.push_back(row.table);
  }
  std::string text;
  for (const std::string& table : tables) {
    const bool outermost = table.empty();
    text += fmt::format("{}| {} | Value | Default | What |\n|---|---|---|---|\n", outermost ? "" : "\n",
                        outermost ? "Key" : fmt::format("Key of `{}`", table.substr(1)));
    std::string ignored_keys;
    for (const KeyDescription& row : rows) {
      if (row.table != table) continue;
      if (row.takes == kIgnored) {
        ignored_keys += fmt::format("{}`{}`", ignored_keys.empty() ? "" : ", ", row.key);
      } else {
        text += fmt::format("| `{}` | {} | {} | {} |\n", row.key, row.takes, row.initial, row.help);
      }
    }
    if (!ignored_keys.empty()) text += fmt::format("| {} | {} | | |\n", ignored_keys, kIgnored);
  }
  return text;
}

}  // namespace hpr
