#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "core/file.h"
#include "walls/config/wall_file.h"

namespace hpr {
namespace {

/// Two projected walls for two viewers, with everything there is to say about them; `edit` replaces a line (from 1).
std::string model_text(int line = 0, const std::string& edit = {}) {
  std::vector<std::string> lines{
      /*  1 */ "hpr_wall = 1",
      /*  2 */ "name = \"model\"",
      /*  3 */ "stereo = { mode = \"anaglyph\" }",
      /*  4 */ "monitors = [{ id = \"operator\", surface = \"arc\", rect = [0, 0, 640, 200], zoom = \"auto\" }]",
      /*  5 */ "[[viewers]]",
      /*  6 */ "id = \"head\"",
      /*  7 */ "tracker = { type = \"udp\", port = 5005, lost = { after_ms = 100, then = \"rest\" } }",
      /*  8 */ "ipd_m = 0.063",
      /*  9 */ "eye_offset_m = [0, 0.02, -0.08]",
      /* 10 */ "position_m = [0, 1.7, 2]",
      /* 11 */ "[[viewers]]",
      /* 12 */ "id = \"guest\"",
      /* 13 */ "position_m = [1, 1.7, 11]",
      /* 14 */ "near_m = 0.05",
      /* 15 */ "[[surfaces]]",
      /* 16 */ "id = \"arc\"",
      /* 17 */ "[surfaces.grid]",
      /* 18 */ "columns = 3",
      /* 19 */ "rows = 1",
      /* 20 */ "tile_pixels = [640, 360]",
      /* 21 */ "tile_size_m = [1.6, 0.9]",
      /* 22 */ "gap_m = [-0.1, 0.0]",
      /* 23 */ "panel_rotate = 180",
      /* 24 */ "mirror = \"horizontal\"",
      /* 25 */ "edge_blend_m = { left = 0.1, right = 0.1, gamma = 1.5 }",
      /* 26 */ "colour = { gamma = [1.1, 1.0, 0.9], gain = 0.95, black = [0.01, 0, 0.02] }",
      /* 27 */ "curve = { radius_m = 4.0 }",
      /* 28 */ "[[surfaces]]",
      /* 29 */ "id = \"side\"",
      /* 30 */ "viewer = \"guest\"",
      /* 31 */ "screens = [",
      /* 32 */
      "  { id = \"side.L\", eye = \"left\", pixels = [64, 36], corners_m = { ll = [0, 0, 9], lr = [1.6, 0, 9], ul = "
      "[0, "
      "0.9, 9] } },",
      /* 33 */
      "  { id = \"side.R\", eye = \"right\", pixels = [64, 36], corners_m = { ll = [0, 0, 9], lr = [1.6, 0, 9], ul = "
      "[0, 0.9, 9] } },",
      /* 34 */ "]",
  };
  if (line > 0) lines.at(static_cast<std::size_t>(line - 1)) = edit;
  std::string text;
  for (const std::string& l : lines) text += l + "\n";
  return text;
}

std::string findings_of(const WallReading& reading, bool errors) {
  std::string all;
  for (const WallFinding& finding : reading.findings) {
    if (finding.error == errors) all += finding.what + "\n";
  }
  return all;
}

std::string errors_of(const std::string& text, const std::vector<std::string>& overrides = {}) {
  return findings_of(parse_wall(text, "t.toml", overrides), true);
}

std::string warnings_of(const std::string& text) {
  return findings_of(parse_wall(text, "t.toml"), false);
}

TEST(WallModel, IsReadAsItStands) {
  const WallReading reading = parse_wall(model_text(), "t.toml");
  EXPECT_EQ(findings_of(reading, true), "");
  EXPECT_EQ(findings_of(reading, false), "t.toml:4:81: not acted on by this version: zoom\n");
  const Wall& wall = reading.wall;
  EXPECT_EQ(wall.stereo, StereoMode::Anaglyph);
  EXPECT_EQ(wall.monitors, (std::vector<WallMonitor>{{"operator", "arc", {640, 200}}}));
  ASSERT_EQ(wall.viewers.size(), 2U);
  EXPECT_EQ(wall.viewers[0].ipd_m, 0.063);
  EXPECT_EQ(wall.viewers[0].eye_offset, glm::dvec3(0.0, 0.02, -0.08));
  EXPECT_EQ(wall.viewers[0].tracker.kind, WallTracker::Kind::Udp);
  EXPECT_EQ(wall.viewers[0].tracker.port, 5005);
  EXPECT_EQ(wall.viewers[0].tracker.lost_after_ms, 100);
  EXPECT_EQ(wall.viewers[0].tracker.lost_then, WallTracker::Lost::Rest);
  EXPECT_EQ(wall.viewers[1].near_m, 0.05);
  ASSERT_EQ(wall.screens.size(), 5U);
  const WallScreen& tile = wall.screens[1];
  EXPECT_EQ(tile.rotate, 180);
  EXPECT_EQ(tile.mirror, Mirror::Horizontal);
  EXPECT_EQ(tile.blend, (EdgeBlend{false, 0.1, 0.1, 0.0, 0.0, 1.5}));
  EXPECT_EQ(tile.color.gamma, glm::dvec3(1.1, 1.0, 0.9));
  EXPECT_EQ(tile.color.gain, glm::dvec3(0.95));
  EXPECT_EQ(tile.viewer, 0U);
  EXPECT_NE(wall.screens[0].lower_left.z, wall.screens[0].lower_right.z);
  EXPECT_EQ(wall.screens[3].eye, Eye::Left);
  EXPECT_EQ(wall.screens[4].eye, Eye::Right);
  EXPECT_EQ(wall.screens[4].viewer, 1U);
}

TEST(WallModel, ExpandedItIsTheSameWall) {
  const Wall wall = parse_wall(model_text(), "t.toml").wall;
  const WallReading again = parse_wall(expand_wall(wall), "expanded");
  ASSERT_TRUE(again.findings.empty()) << again.findings.front().what;
  EXPECT_EQ(again.wall, wall);
  EXPECT_EQ(expand_wall(again.wall), expand_wall(wall));
}

TEST(WallModel, EveryPartOfItChangesTheHash) {
  const std::uint64_t hash = parse_wall(model_text(), "t.toml").wall.hash;
  const std::pair<int, const char*> edits[] = {
      {3, "stereo = { mode = \"top-bottom\" }"},
      {4, "monitors = [{ id = \"operator\", surface = \"arc\", rect = [0, 0, 641, 200] }]"},
      {8, "ipd_m = 0.064"},
      {9, "eye_offset_m = [0, 0.03, -0.08]"},
      {7, "tracker = { type = \"udp\", port = 5006, lost = { after_ms = 100, then = \"rest\" } }"},
      {13, "position_m = [1, 1.8, 0]"},
      {23, "panel_rotate = 0"},
      {24, "mirror = \"vertical\""},
      {25, "edge_blend_m = { left = 0.1, right = 0.1, gamma = 1.6 }"},
      {25, "edge_blend_m = \"auto\""},
      {26, "colour = { gamma = [1.1, 1.0, 0.9], gain = 0.95, black = [0.01, 0, 0.03] }"},
      {27, "curve = { radius_m = 5.0 }"},
      {30, "viewer = \"head\""},
  };
  for (const auto& [line, edit] : edits) {
    const WallReading reading = parse_wall(model_text(line, edit), "t.toml");
    EXPECT_EQ(findings_of(reading, true), "") << edit;
    EXPECT_NE(reading.wall.hash, hash) << edit;
    EXPECT_EQ(parse_wall(expand_wall(reading.wall), "expanded").wall, reading.wall) << edit;
  }
}

struct BadLine {
  const char* name;
  int line;
  const char* text;
  const char* finding;
  const char* hint;
};

class WallModelErrors : public testing::TestWithParam<BadLine> {};

TEST_P(WallModelErrors, NameTheirPlaceAndAHint) {
  const BadLine& bad = GetParam();
  const WallReading reading = parse_wall(model_text(bad.line, bad.text), "t.toml");
  EXPECT_EQ(findings_of(reading, true), fmt::format("{}\n", bad.finding));
  for (const WallFinding& finding : reading.findings) {
    if (finding.error) {
      EXPECT_NE(finding.hint.find(bad.hint), std::string::npos) << finding.hint;
    }
  }
}

const BadLine kBadLines[] = {
    {"StereoMode", 3, "stereo = { mode = \"anaglif\" }", "t.toml:3:19: 'mode' of stereo is \"anaglif\"",
     "did you mean 'anaglyph'?"},
    {"MonitorSurface", 4, "monitors = [{ id = \"operator\", surface = \"ark\", rect = [0, 0, 64, 20] }]",
     "t.toml:4:42: monitor \"operator\" shows surface \"ark\", which does not exist", "did you mean 'arc'?"},
    {"MonitorName", 4, "monitors = [{ id = \"side.L\", surface = \"arc\", rect = [0, 0, 64, 20] }]",
     "t.toml:4:13: monitor \"side.L\" is called as something else", "its own id"},
    {"MonitorSize", 4, "monitors = [{ id = \"operator\", surface = \"arc\" }]",
     "t.toml:4:13: a monitor has either a rect or pixels", "pixels = [1920, 540]"},
    {"Tracker", 7, "tracker = { type = \"upd\", port = 5005 }", "t.toml:7:20: 'type' of tracker is \"upd\"",
     "did you mean 'udp'?"},
    {"TrackerPort", 7, "tracker = { type = \"udp\" }", "t.toml:7:11: tracker has no 'port'", "port = 5005"},
    {"TrackerFile", 7, "tracker = { type = \"file\", path = \"no/walk.csv\" }",
     "t.toml:7:35: 'path' of tracker cannot be used: cannot read 'no/walk.csv': No such file or directory", ""},
    {"ViewerTwice", 6, "id = \"guest\"", "t.toml:11:1: there are two viewers \"guest\"", "its own id"},
    {"ViewerNowhere", 13, "", "t.toml:11:1: viewer \"guest\" of several has no position_m", "position_m"},
    {"NegativeIpd", 14, "ipd_m = -1", "t.toml:14:9: 'ipd_m' of viewer is -1", "from 0 to 10"},
    {"Rotate", 23, "panel_rotate = 45", "t.toml:23:16: 'panel_rotate' of grid is 45", "0, 90, 180 or 270"},
    {"Mirror", 24, "mirror = \"horizontl\"", "t.toml:24:10: 'mirror' of grid is \"horizontl\"",
     "did you mean 'horizontal'?"},
    {"Blend", 25, "edge_blend_m = \"automatic\"", "t.toml:25:16: 'edge_blend_m' of grid is \"automatic\"", "\"auto\""},
    {"BlendSide", 25, "edge_blend_m = { auto = true, left = 0.1 }",
     "t.toml:25:38: 'left' of edge_blend_m stands beside auto", "either"},
    {"NegativeBlend", 25, "edge_blend_m = { left = -0.1 }", "t.toml:25:25: 'left' of edge_blend_m is -0.1",
     "from 0 to"},
    {"Colour", 26, "colour = { gain = [1, 1] }", "t.toml:26:19: 'gain' of colour has 2 values", "3 numbers"},
    {"ColourRange", 26, "colour = { black = 1.5 }", "t.toml:26:20: 'black' of colour holds 1.5", "from 0 to 1"},
    {"SurfaceViewer", 30, "viewer = \"gast\"",
     "t.toml:30:10: surface \"side\" is seen by viewer \"gast\", who does not exist", "did you mean 'guest'?"},
    {"SurfaceTwice", 29, "id = \"arc\"", "t.toml:28:1: there are two surfaces \"arc\"", "its own id"},
    {"Eye", 32,
     "  { id = \"side.L\", eye = \"lift\", pixels = [64, 36], corners_m = { ll = [0, 0, 8], lr = [1.6, 0, 8], ul = [0, "
     "0.9, 8] } },",
     "t.toml:32:26: 'eye' of screen is \"lift\"", "did you mean 'left'?"},
    {"SameEyeTwice", 32,
     "  { id = \"side.L\", eye = \"right\", pixels = [64, 36], corners_m = { ll = [0, 0, 9], lr = [1.6, 0, 9], ul = "
     "[0, "
     "0.9, 9] } },",
     "t.toml:33:3: tile driven twice: screens \"side.L\" and \"side.R\" are the same rectangle", "eye = \"left\""},
};

INSTANTIATE_TEST_SUITE_P(Lines, WallModelErrors, testing::ValuesIn(kBadLines),
                         [](const auto& bad) { return std::string(bad.param.name); });

TEST(WallModel, AllThatIsWrongIsToldAtOnce) {
  std::string text = model_text(3, "stereo = { mode = \"x\" }");
  text.replace(text.find("port = 5005"), 11, "port = -5");
  text.replace(text.find("\"horizontal\""), 12, "\"up\"");
  text.replace(text.find("viewer = \"guest\""), 16, "viewer = \"ghost\"");
  EXPECT_EQ(errors_of(text),
            "t.toml:3:19: 'mode' of stereo is \"x\"\n"
            "t.toml:7:34: 'port' of tracker is -5\n"
            "t.toml:24:10: 'mirror' of grid is \"up\"\n"
            "t.toml:30:10: surface \"side\" is seen by viewer \"ghost\", who does not exist\n");
}

TEST(WallModel, WhatCannotLookRightIsAWarning) {
  const std::string head = "hpr_wall = 1\n";
  const std::string grid =
      "[[surfaces]]\n[surfaces.grid]\ncolumns = 2\nrows = 1\ntile_pixels = [64, 36]\ntile_size_m = [1.6, 0.9]\n";
  EXPECT_EQ(warnings_of(head + "stereo = { mode = \"passive\" }\n" + grid),
            "t.toml:2:19: stereo is passive, and screens without an eye show one picture for both\n"
            "t.toml:2:19: both eyes see the same: no viewer has an ipd_m\n");
  EXPECT_EQ(warnings_of(head +
                        "viewers = [{ id = \"a\", position_m = [0, 0, 1], ipd_m = 0.06 }, { id = \"b\", "
                        "position_m = [0, 0, 2] }]\nstereo = { mode = \"side-by-side\" }\n" +
                        grid + "eye = \"left\"\n"),
            "t.toml:2:64: no surface is seen by viewer \"b\"\n"
            "t.toml:3:19: all screens are for one eye, so the stereo mode changes nothing\n");
  const auto two = [&](const std::string& first, const std::string& second) {
    return head +
           "[[surfaces]]\nscreens = [\n{ id = \"a\", pixels = [160, 90], corners_m = { ll = [0, 0, 0], lr = "
           "[1.6, 0, 0], ul = [0, 0.9, 0] }" +
           first + " },\n{ id = \"b\", " + second + " },\n]\n";
  };
  const std::string beside = "corners_m = { ll = [1.61, 0, 0], lr = [3.21, 0, 0], ul = [1.61, 0.9, 0] }";
  EXPECT_EQ(warnings_of(two("", "pixels = [160, 90], " + beside)), "");
  EXPECT_EQ(warnings_of(two("", "pixels = [320, 180], " + beside)),
            "t.toml:5:1: screens \"a\" and \"b\" are neighbours with pixels of 10 and 5 mm\n");
  const std::string apart = "corners_m = { ll = [1.61, 0, 1], lr = [3.21, 0, 1], ul = [1.61, 0.9, 1] }";
  EXPECT_EQ(warnings_of(two("", "pixels = [320, 180], " + apart)), "");
  const std::string over = "corners_m = { ll = [1.5, 0, 0], lr = [3.1, 0, 0], ul = [1.5, 0.9, 0] }";
  EXPECT_EQ(warnings_of(two(", edge_blend_m = 0.1", "pixels = [160, 90], " + over)),
            "t.toml:5:1: screen \"b\" overlaps \"a\" by 100 mm and does not fade its edge as that one does\n");
  EXPECT_EQ(warnings_of(two("", "pixels = [160, 90], " + over)), "");
  EXPECT_EQ(warnings_of(two(", edge_blend_m = 0.1", "pixels = [160, 90], " + beside)),
            "t.toml:4:1: screen \"a\" fades its edges and overlaps no screen of its plane\n");
  EXPECT_EQ(warnings_of(two(", edge_blend_m = \"auto\"", "pixels = [160, 90], " + beside)), "");
  const auto seen_from_z = [&](const std::string& z) {
    return warnings_of(two("", "pixels = [160, 90], " + beside) + "[[viewers]]\nposition_m = [1.6, 0.45, " + z + "]\n");
  };
  EXPECT_EQ(seen_from_z("1"), "");
  EXPECT_EQ(seen_from_z("-1"), "t.toml:7:1: viewer stands behind screen \"a\"\n");
}

TEST(WallModel, RecordedPathsAreLookedForBesideTheWallFile) {
  const auto folder = std::filesystem::temp_directory_path() / ("hpr_model" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder / "paths");
  write_file_atomically(folder / "paths" / "walk.csv", "0,0,1.7,0\n1,1,1.7,0\n");
  const std::string tracked = model_text(7, "tracker = { type = \"file\", path = \"paths/walk.csv\", rate_hz = 25 }");
  write_file_atomically(folder / "wall.toml", tracked);
  const Wall wall = load_wall((folder / "wall.toml").string());
  EXPECT_EQ(wall.viewers[0].tracker.path, "paths/walk.csv");
  EXPECT_EQ(wall.viewers[0].tracker.file, (folder / "paths" / "walk.csv").string());
  EXPECT_EQ(wall.viewers[0].tracker.rate_hz, 25.0);
  write_file_atomically(folder / "expanded.toml", expand_wall(wall));
  EXPECT_EQ(load_wall((folder / "expanded.toml").string()), wall);

  write_file_atomically(folder / "wall.toml", model_text() + "[test]\nviewer_path = \"paths/walk.csv\"\n");
  EXPECT_EQ(load_wall((folder / "wall.toml").string()).viewers[0].tracker.kind, WallTracker::Kind::File);

  write_file_atomically(folder / "paths" / "walk.csv", "0,0,1.7,0\n0,1,1.7,0\n");
  const WallReading reading = read_wall((folder / "wall.toml").string());
  ASSERT_FALSE(reading.ok());
  const std::string errors = findings_of(reading, true);
  EXPECT_NE(errors.find("'viewer_path' of test cannot be used"), std::string::npos) << errors;
  EXPECT_NE(errors.find("walk.csv:2: time 0 comes after 0"), std::string::npos) << errors;
  std::filesystem::remove_all(folder);
}

TEST(WallOverrides, PutValuesOverTheFiles) {
  const auto wall = [](const std::vector<std::string>& overrides) {
    const WallReading reading = parse_wall(model_text(), "t.toml", overrides);
    EXPECT_EQ(findings_of(reading, true), "");
    return reading.wall;
  };
  EXPECT_EQ(wall({"viewers.1.position_m=[0,1.6,0.5]"}).viewers[1].position, glm::dvec3(0.0, 1.6, 0.5));
  EXPECT_EQ(wall({"stereo.mode=top-bottom"}).stereo, StereoMode::TopBottom);
  EXPECT_EQ(wall({"stereo.mode=\"none\""}).stereo, StereoMode::None);
  EXPECT_EQ(wall({"test.gap_rgba=[1, 2, 3, 4]"}).gap_color, (Rgba8{1, 2, 3, 4}));
  EXPECT_EQ(wall({"viewers.1.id=other", "surfaces.1.viewer=other"}).viewers[1].id, "other");
  EXPECT_EQ(wall({"surfaces.1.screens.0.colour={ gain = 0.5 }"}).screens[3].color.gain, glm::dvec3(0.5));
  EXPECT_EQ(wall({"monitors.1={ id = \"two\", surface = \"arc\", pixels = [8, 4] }"}).monitors.size(), 2U);
  EXPECT_EQ(wall({"surfaces.0.grid.columns=2", "surfaces.0.grid.columns=4"}).screens.size(), 6U);
  const Wall grid = load_wall("2x1", {"viewers.0.position_m=[0,0,2]"});
  EXPECT_TRUE(grid.viewers[0].has_position);
  EXPECT_NE(grid.hash, load_wall("2x1").hash);
}

TEST(WallOverrides, ErrorsNameTheOption) {
  const auto error = [](const std::string& override) { return errors_of(model_text(), {override}); };
  EXPECT_EQ(error("stereo.mode=5"), "--set stereo.mode=5: 'mode' of stereo is an integer\n");
  EXPECT_EQ(error("stereo.moed=none"), "--set stereo.moed=none: stereo has no key 'moed'\n");
  EXPECT_EQ(error("viewers.0.position_m=[0,1]"),
            "--set viewers.0.position_m=[0,1]: 'position_m' of viewer has 2 values\n");
  EXPECT_EQ(error("viewers.7.ipd_m=1"), "--set viewers.7.ipd_m=1: '7' of the path is beyond the 2 there are\n");
  EXPECT_EQ(error("viewers.first.ipd_m=1"), "--set viewers.first.ipd_m=1: 'first' of the path takes a number\n");
  EXPECT_EQ(error("name.x=1"), "--set name.x=1: 'x' of the path is inside a string\n");
}

TEST(WallOverrides, MalformedOnesAreMisuse) {
  const auto error = [](const std::string& override) -> std::string {
    try {
      return errors_of(model_text(), {override});
    } catch (const Error& thrown) {
      EXPECT_EQ(thrown.code(), ExitCode::Usage);
      EXPECT_NE(thrown.hint(), "");
      return thrown.what();
    }
  };
  EXPECT_EQ(error("stereo.mode"), "--set stereo.mode: the value is neither TOML nor a word");
  EXPECT_EQ(error("name="), "--set name=: the value is neither TOML nor a word");
  EXPECT_EQ(error("stereo.mode=[1"), "--set stereo.mode=[1: the value is neither TOML nor a word");
  EXPECT_EQ(error("stereo.mode=1\nx=2"), "--set stereo.mode=1\\x0ax=2: the value is neither TOML nor a word");
  EXPECT_EQ(error(".mode=1"), "--set .mode=1: a key of the path is empty");
  EXPECT_EQ(error("=1"), "--set =1: a key of the path is empty");
}

TEST(WallOverrides, ErrorsOfAShorthandNameItAndNoLineOfItsExpansion) {
  const auto finding = [](const std::string& override) { return read_wall("2x2", {override}).findings.at(0); };
  const WallFinding skewed = finding("surfaces.0.screens.0.corners_m.ll=[5,5,5]");
  EXPECT_TRUE(skewed.what.starts_with("2x2 with --set surfaces.0.screens.0.corners_m.ll=[5,5,5]: 'corners_m'"))
      << skewed.what;
  EXPECT_EQ(skewed.line, "");
  EXPECT_EQ(skewed.position.line, 0);
  const WallFinding grid = finding("surfaces.0.grid.gap_m=[1,2,3]");
  EXPECT_TRUE(grid.what.starts_with("2x2 with --set surfaces.0.grid.gap_m=[1,2,3]: ")) << grid.what;
}

}  // namespace
}  // namespace hpr
