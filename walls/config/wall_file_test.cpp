#include "walls/config/wall_file.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <glm/geometric.hpp>

#include "core/file.h"
#include "walls/config/example_walls.h"

namespace hpr {
namespace {

/// A sound wall of two screens, one statement a line; `edit` replaces a line (from 1).
std::string wall_text(int line = 0, const std::string& edit = {}) {
  std::vector<std::string> lines{
      /*  1 */ "hpr_wall = 1",
      /*  2 */ "name = \"test\"",
      /*  3 */ "nodes = [{ id = \"n0\", host = \"a\", ranks = 1 }, { id = \"n1\", host = \"b\", ranks = 1 }]",
      /*  4 */ "windows = [",
      /*  5 */ "  { id = \"w0\", node = \"n0\", rank = 0, display = \":0\", rect = [0, 0, 64, 36] },",
      /*  6 */ "  { id = \"w1\", node = \"n1\", rank = 1, display = \":0\", rect = [0, 0, 64, 36] },",
      /*  7 */ "]",
      /*  8 */ "[[surfaces]]",
      /*  9 */ "id = \"wall\"",
      /* 10 */ "screens = [",
      /* 11 */
      "  { id = \"a\", window = \"w0\", pixels = [64, 36], corners_m = { ll = [0, 0, 0], lr = [1.6, 0, 0], ul = [0, "
      "0.9, 0] } },",
      /* 12 */
      "  { id = \"b\", window = \"w1\", pixels = [64, 36], corners_m = { ll = [2, 0, 0], lr = [3.6, 0, 0], ul = [2, "
      "0.9, 0] } },",
      /* 13 */ "]",
      /* 14 */ "[[viewers]]",
      /* 15 */ "position_m = [1.0, 0.5, 2.0]",
  };
  if (line > 0) lines.at(static_cast<std::size_t>(line - 1)) = edit;
  std::string text;
  for (const std::string& l : lines) text += l + "\n";
  return text;
}

std::string grid_text(const std::string& more, const std::string& head = {}) {
  return "hpr_wall = 1\n" + head +
         "[[surfaces]]\nid = \"wall\"\n[surfaces.grid]\ncolumns = 3\nrows = 2\ntile_pixels = [640, 360]\n"
         "tile_size_m = [0.512, 0.288]\n" +
         more;
}

/// All findings that are errors, one a line.
std::string errors_of(const std::string& text) {
  std::string all;
  for (const WallFinding& finding : parse_wall(text, "t.toml").findings) {
    if (finding.error) all += finding.what + "\n";
  }
  return all;
}

std::string warnings_of(const std::string& text) {
  std::string all;
  for (const WallFinding& finding : parse_wall(text, "t.toml").findings) {
    if (!finding.error) all += finding.what + "\n";
  }
  return all;
}

TEST(WallFile, ASoundWallHasNoFindings) {
  const WallReading reading = parse_wall(wall_text(), "t.toml");
  EXPECT_TRUE(reading.findings.empty()) << reading.findings.front().what;
  ASSERT_EQ(reading.wall.screens.size(), 2U);
  const WallScreen& b = reading.wall.screens[1];
  EXPECT_EQ(b.id, "b");
  EXPECT_EQ(b.node, "n1");
  EXPECT_EQ(b.window, "w1");
  EXPECT_EQ(b.rank, 1);
  EXPECT_EQ(b.pixels, (Size{64, 36}));
  EXPECT_EQ(b.lower_right, glm::dvec3(3.6, 0.0, 0.0));
  EXPECT_EQ(b.viewport, (Rect{0, 0, 64, 36}));
  EXPECT_TRUE(reading.wall.viewers.front().has_position);
  EXPECT_EQ(reading.wall.viewers.front().position, glm::dvec3(1.0, 0.5, 2.0));
}

struct BadLine {
  const char* name;
  int line;
  const char* text;
  const char* finding;  ///< the only error, or the start of the first
  const char* hint;     ///< part of its hint
};

class WallFileErrors : public testing::TestWithParam<BadLine> {};

TEST_P(WallFileErrors, NameTheirPlaceTheLineAndAHint) {
  const BadLine& bad = GetParam();
  const WallReading reading = parse_wall(wall_text(bad.line, bad.text), "t.toml");
  ASSERT_FALSE(reading.ok());
  const auto first = std::ranges::find_if(reading.findings, &WallFinding::error);
  EXPECT_EQ(first->what.substr(0, std::string(bad.finding).size()), bad.finding);
  EXPECT_NE(first->hint.find(bad.hint), std::string::npos) << first->hint;
  // The rule about windows and screens points at the screen.
  if (first->position.line == bad.line) {
    EXPECT_EQ(first->line, bad.text);
  }
  EXPECT_FALSE(first->line.empty());
}

const BadLine kBadLines[] = {
    {"Version", 1, "hpr_wall = 2", "t.toml:1:12: 'hpr_wall' of the wall is not 1", "version 1"},
    {"WrongType", 2, "name = 7", "t.toml:2:8: 'name' of the wall is an integer", "a string"},
    {"UnknownTopKey", 2, "nam = \"x\"", "t.toml:2:1: the wall has no key 'nam'", "did you mean 'name'?"},
    {"UnknownKey", 5, "  { id = \"w0\", node = \"n0\", dispaly = \":0\", rect = [0, 0, 64, 36] },",
     "t.toml:5:29: window has no key 'dispaly'", "did you mean 'display'?"},
    {"MissingId", 5, "  { node = \"n0\", rect = [0, 0, 64, 36] },", "t.toml:5:3: window has no 'id'", "add id"},
    {"BadId", 5, "  { id = \"../w0\", node = \"n0\" },", "t.toml:5:10: 'id' of window is \"../w0\"", "letters"},
    {"DuplicateNode", 3, "nodes = [{ id = \"n0\" }, { id = \"n1\" }, { id = \"n0\" }]",
     "t.toml:3:40: there are two nodes \"n0\"", "line 3"},
    {"DuplicateWindow", 6, "  { id = \"w0\", node = \"n1\", rank = 1 },", "t.toml:6:3: there are two windows \"w0\"",
     "line 5"},
    {"UnknownNode", 6, "  { id = \"w1\", node = \"n2\", rect = [0, 0, 64, 36] },",
     "t.toml:6:23: window \"w1\" is on node \"n2\", which does not exist", "choices: n0, n1"},
    {"UnknownGpu", 6, "  { id = \"w1\", node = \"n1\", gpu = \"g7\" },",
     "t.toml:6:35: window \"w1\" is on gpu \"g7\", which node \"n1\" does not have", "no gpus"},
    {"RankOnTwoNodes", 6, "  { id = \"w1\", node = \"n1\", rank = 0 },",
     "t.toml:6:36: rank 0 is wanted on two nodes, \"n0\" and \"n1\"", "one node"},
    {"RankTooLarge", 6, "  { id = \"w1\", node = \"n1\", rank = 2 },", "t.toml:6:36: window \"w1\" wants rank 2 of 2",
     "0 to 1"},
    {"WindowsOverlap", 6, "  { id = \"w1\", node = \"n0\", display = \":0\", rect = [60, 30, 64, 36] },",
     "t.toml:6:3: tile driven twice: windows \"w0\" and \"w1\" overlap by 4 x 6 pixels", "move one"},
    {"NegativeRect", 6, "  { id = \"w1\", node = \"n1\", rect = [0, 0, -64, 36] },",
     "t.toml:6:36: 'rect' of window is -64 x 36 pixels", "positive"},
    {"UnknownWindow", 12,
     "  { id = \"b\", window = \"w2\", pixels = [64, 36], corners_m = { ll = [2, 0, 0], lr = [3.6, 0, 0], ul = [2, "
     "0.9, 0] } },",
     "t.toml:12:24: screen \"b\" is shown in window \"w2\", which does not exist", "choices: w0, w1"},
    {"WindowTwice", 12,
     "  { id = \"b\", window = \"w0\", pixels = [64, 36], corners_m = { ll = [2, 0, 0], lr = [3.6, 0, 0], ul = [2, "
     "0.9, 0] } },",
     "t.toml:12:24: tile driven twice: window \"w0\" shows screens \"a\" and \"b\"", "own window"},
    {"TwoNodes", 12,
     "  { id = \"a\", window = \"w1\", pixels = [64, 36], corners_m = { ll = [2, 0, 0], lr = [3.6, 0, 0], ul = [2, "
     "0.9, 0] } },",
     "t.toml:12:3: screen \"a\" is driven by two nodes, \"n0\" and \"n1\"", "line 11"},
    {"SamePlace", 12,
     "  { id = \"b\", window = \"w1\", pixels = [64, 36], corners_m = { ll = [0, 0, 0], lr = [1.6, 0, 0], ul = [0, "
     "0.9, 0] } },",
     "t.toml:12:3: tile driven twice: screens \"a\" and \"b\" are the same rectangle", "remove one"},
    {"CalledWall", 12,
     "  { id = \"wall\", window = \"w1\", pixels = [64, 36], corners_m = { ll = [2, 0, 0], lr = [3.6, 0, 0], ul = [2, "
     "0.9, 0] } },",
     "t.toml:12:3: a picture must not be called \"wall\"", "wall.png"},
    {"WindowTooSmall", 5, "  { id = \"w0\", node = \"n0\", rank = 0, rect = [0, 0, 64, 35] },",
     "t.toml:11:3: screen \"a\" needs 64 x 36 pixels at (0, 0) of window \"w0\", which has 64 x 35", "that size"},
    {"Skewed", 12,
     "  { id = \"b\", window = \"w1\", pixels = [64, 36], corners_m = { ll = [2, 0, 0], lr = [3.6, 0, 0], ul = [2.001, "
     "0.9, 0] } },",
     "t.toml:12:61: 'corners_m' of screen meet at 89.936 degrees", "warp"},
    {"NoArea", 12,
     "  { id = \"b\", window = \"w1\", pixels = [64, 36], corners_m = { ll = [2, 0, 0], lr = [2, 0, 0], ul = [2, 0.9, "
     "0] } },",
     "t.toml:12:61: 'corners_m' of screen span 0 x 0.9 m", "positive width"},
    {"CornerMissing", 12,
     "  { id = \"b\", window = \"w1\", pixels = [64, 36], corners_m = { ll = [2, 0, 0], lr = [2, 0, 0] } },",
     "t.toml:12:61: corners_m has no 'ul'", "add ul = [x, y, z]"},
    {"NotFinite", 15, "position_m = [1.0, nan, 2.0]", "t.toml:15:20: 'position_m' of viewer holds nan", "finite"},
    {"TooFar", 15, "position_m = [1.0, 1e300, 2.0]", "t.toml:15:20: 'position_m' of viewer holds 1e+300", "within"},
    {"TwoNumbers", 15, "position_m = [1.0, 2.0]", "t.toml:15:14: 'position_m' of viewer has 2 values", "3 numbers"},
    {"ZeroNear", 15, "near_m = 0", "t.toml:15:10: 'near_m' of viewer is 0", "above 0"},
    {"ZeroPixels", 12,
     "  { id = \"b\", window = \"w1\", pixels = [64, 0], corners_m = { ll = [2, 0, 0], lr = [3.6, 0, 0], ul = [2, 0.9, "
     "0] } },",
     "t.toml:12:44: 'pixels' of screen holds 0", "from 1 to 65536"},
    {"PixelsBeyondLimit", 12,
     "  { id = \"b\", window = \"w1\", pixels = [65537, 36], corners_m = { ll = [2, 0, 0], lr = [3.6, 0, 0], ul = [2, "
     "0.9, 0] } },",
     "t.toml:12:40: 'pixels' of screen holds 65537", "from 1 to 65536"},
    {"Rotate", 12,
     "  { id = \"b\", rotate = 45, pixels = [64, 36], corners_m = { ll = [2, 0, 0], lr = [3.6, 0, 0], ul = [2, 0.9, 0] "
     "} },",
     "t.toml:12:24: 'rotate' of screen is 45", "0, 90, 180 or 270"},
    {"Syntax", 2, "name = ", "t.toml:2:8: ", "TOML"},
    {"DuplicateKey", 2, "hpr_wall = 1", "t.toml:2:", "TOML"},
};
INSTANTIATE_TEST_SUITE_P(Lines, WallFileErrors, testing::ValuesIn(kBadLines),
                         [](const auto& bad) { return std::string(bad.param.name); });

TEST(WallFile, AllErrorsAreReportedAndLoadThrowsTheFirst) {
  std::string text = wall_text(5, "  { id = \"w0\", node = \"n9\", dispaly = 1 },");
  text += "near_m = -1\n";
  EXPECT_EQ(errors_of(text),
            "t.toml:5:23: window \"w0\" is on node \"n9\", which does not exist\n"
            "t.toml:5:29: window has no key 'dispaly'\n"
            "t.toml:16:10: 'near_m' of viewer is -1\n");
  const auto file = std::filesystem::temp_directory_path() / "hpr_wall_file_test_first.toml";
  write_file_atomically(file, text);
  try {
    static_cast<void>(load_wall(file.string()));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::BadInput);
    EXPECT_EQ(error.what(), file.string() + ":5:23: window \"w0\" is on node \"n9\", which does not exist");
    EXPECT_EQ(error.line(), "  { id = \"w0\", node = \"n9\", dispaly = 1 },");
    EXPECT_NE(error.hint().find("choices: n0, n1"), std::string::npos);
  }
  std::filesystem::remove(file);
}

TEST(WallFile, AMissingFileIsAnIoErrorThatExplainsWhatAWallIs) {
  try {
    static_cast<void>(load_wall("/nowhere/wall.toml"));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Io);
    EXPECT_NE(error.hint().find("3x2"), std::string::npos);
  }
}

TEST(WallFile, AGridIsExpandedFromTheTopLeftWithItsGapsInMetres) {
  const WallReading reading = parse_wall(grid_text("gap_m = [0.010, 0.020]\ncentre_m = [0, 1.2, -1]\n"), "t.toml");
  ASSERT_TRUE(reading.ok()) << reading.findings.front().what;
  const auto& screens = reading.wall.screens;
  ASSERT_EQ(screens.size(), 6U);
  EXPECT_EQ(screens[0].id, "wall-r0c0");
  EXPECT_EQ(screens[5].id, "wall-r1c2");
  EXPECT_NEAR(screens[0].lower_left.x, -0.778, 1e-15);
  EXPECT_NEAR(screens[0].upper_left.y, 1.2 + 0.298, 1e-15);
  EXPECT_NEAR(screens[1].lower_left.x - screens[0].lower_right.x, 0.010, 1e-15);
  EXPECT_NEAR(screens[0].lower_left.y - screens[3].upper_left.y, 0.020, 1e-15);
  EXPECT_NEAR(screens[5].lower_right.x, 0.778, 1e-15);
  EXPECT_NEAR(screens[5].lower_right.y, 1.2 - 0.298, 1e-15);
  EXPECT_EQ(screens[5].lower_right.z, -1.0);
  EXPECT_FALSE(reading.wall.viewers.front().has_position);
  // One wall height before the middle.
  EXPECT_NEAR(glm::distance(reading.wall.viewers.front().position, glm::dvec3(0.0, 1.2, -1.0 + 0.596)), 0.0, 1e-14);
}

TEST(WallFile, GapsOfAGridMayDifferOneByOne) {
  const WallReading reading = parse_wall(grid_text("gap_m = [0.5, 0.25]\ncolumn_gaps_m = [0.010, -0.020]\n"), "t.toml");
  ASSERT_TRUE(reading.ok()) << reading.findings.front().what;
  const auto& screens = reading.wall.screens;
  EXPECT_NEAR(screens[1].lower_left.x - screens[0].lower_right.x, 0.010, 1e-15);
  EXPECT_NEAR(screens[2].lower_left.x - screens[1].lower_right.x, -0.020, 1e-15);
  EXPECT_NEAR(screens[0].lower_left.y - screens[3].upper_left.y, 0.25, 1e-15);
}

TEST(WallFile, AGridIsChecked) {
  EXPECT_EQ(errors_of(grid_text("windows = [\"w0\"]\n", "windows = [{ id = \"w0\" }]\n")),
            "t.toml:10:11: 'windows' of grid names 1 windows for 3 x 2 screens\n");
  EXPECT_EQ(errors_of(grid_text("column_gaps_m = [0.01]\n")), "t.toml:9:17: 'column_gaps_m' of grid has 1 values\n");
  EXPECT_EQ(errors_of(grid_text("gap_m = [-0.512, 0]\n")),
            "t.toml:9:9: 'gap_m' of grid overlaps tiles by 0.512 m, a whole tile\n");
  EXPECT_EQ(errors_of(grid_text("colums = 3\n")), "t.toml:9:1: grid has no key 'colums'\n");
  EXPECT_EQ(errors_of("hpr_wall = 1\n[[surfaces]]\n[surfaces.grid]\ncolumns = 100\nrows = 100\ntile_pixels = [1, 1]\n"
                      "tile_size_m = [1, -1]\n"),
            "t.toml:4:11: 'columns' of grid times rows is 10000 screens\n"
            "t.toml:7:15: 'tile_size_m' of grid is 1 x -1 m\n");
  EXPECT_EQ(errors_of("hpr_wall = 1\n[[surfaces]]\nid = \"a\"\n"),
            "t.toml:2:1: surface \"a\" has neither a grid nor screens\n");
  EXPECT_EQ(errors_of("hpr_wall = 1\n"), "t.toml:1:1: the wall has no 'surfaces'\n");
}

TEST(WallFile, AWindowMayShowSeveralScreensInDistinctViewports) {
  const auto text = [](const std::string& viewport) {
    return "hpr_wall = 1\nwindows = [{ id = \"w\", rect = [0, 0, 128, 36] }]\n[[surfaces]]\nscreens = [\n"
           "{ id = \"a\", window = \"w\", viewport = [0, 0, 64, 36], pixels = [64, 36], corners_m = { ll = [0, 0, 0], "
           "lr "
           "= [1.6, 0, 0], ul = [0, 0.9, 0] } },\n"
           "{ id = \"b\", window = \"w\", viewport = " +
           viewport + ", pixels = [64, 36], corners_m = { ll = [2, 0, 0], lr = [3.6, 0, 0], ul = [2, 0.9, 0] } },\n]\n";
  };
  EXPECT_EQ(errors_of(text("[64, 0, 64, 36]")), "");
  EXPECT_EQ(errors_of(text("[63, 0, 64, 36]")),
            "t.toml:6:22: tile driven twice: window \"w\" shows screens \"a\" and \"b\" in overlapping viewports\n");
  EXPECT_EQ(errors_of(text("[65, 0, 64, 36]")),
            "t.toml:6:1: screen \"b\" needs 64 x 36 pixels at (65, 0) of window \"w\", which has 128 x 36\n");
  EXPECT_EQ(errors_of(text("[64, 0, 64, 35]")),
            "t.toml:6:1: screen \"b\" shows 64 x 36 pixels in a viewport of 64 x 35\n");
}

TEST(WallFile, ATurnedScreenFillsAWindowOfSwappedSides) {
  const std::string turned =
      "hpr_wall = 1\nwindows = [{ id = \"w\", rect = [0, 0, 64, 36] }]\n[[surfaces]]\nscreens = [{ id = \"a\", window "
      "= "
      "\"w\", rotate = 90, pixels = [36, 64], corners_m = { ll = [0, 0, 0], lr = [0.9, 0, 0], ul = [0, 1.6, 0] } }]\n";
  const WallReading reading = parse_wall(turned, "t.toml");
  ASSERT_TRUE(reading.findings.empty()) << reading.findings.front().what;
  EXPECT_EQ(reading.wall.screens[0].viewport, (Rect{0, 0, 64, 36}));
}

TEST(WallFile, OddPixelShapesAndIgnoredKeysAreWarnings) {
  const std::string text =
      wall_text(12,
                "  { id = \"b\", pixels = [36, 64], corners_m = { ll = [2, 0, 0], lr = [3.6, 0, 0], ul = "
                "[2, 0.9, 0] }, overscan_px = 8 },") +
      "ipd_m = 0.06\n[sync]\nswap = \"barrier\"\n[x_site]\nroom = 7\n[render]\nstrategy = 3\n";
  EXPECT_EQ(errors_of(text), "");
  EXPECT_EQ(warnings_of(text),
            "t.toml:6:3: window \"w1\" shows no screen\n"
            "t.toml:12:3: the pixels of screen \"b\" are 44.44 x 14.06 mm, not square\n"
            "t.toml:12:116: not acted on by this version: overscan_px, sync, render\n");
}

TEST(WallFile, AShorthandIsAGridWithoutViewer) {
  const Wall wall = load_wall("3x2");
  ASSERT_EQ(wall.screens.size(), 6U);
  EXPECT_EQ(wall.screens[4].pixels, (Size{640, 360}));
  EXPECT_FALSE(wall.viewers.front().has_position);
  EXPECT_TRUE(wall.screens[0].window.empty());
  EXPECT_NEAR(wall.screens[1].lower_left.x - wall.screens[0].lower_right.x, 0.006, 1e-15);
  EXPECT_EQ(load_wall("1x1@1x65536").screens[0].pixels, (Size{1, 65536}));
  const auto code_of = [](const char* spec) {
    try {
      static_cast<void>(load_wall(spec));
    } catch (const Error& error) {
      return error.code();
    }
    return ExitCode::Done;
  };
  for (const char* const none : {"0x1", "1x0", "1x1@0x1"}) EXPECT_EQ(code_of(none), ExitCode::Usage) << none;
  for (const char* const many : {"4097x1", "65x65", "99999999999999999999x1", "1x1@1x65537"}) {
    EXPECT_EQ(code_of(many), ExitCode::Limit) << many;
  }
  for (const char* const other : {"3x", "x2", "3", "3x2@", "3x2@640", "3x2.toml", "-3x2", "3x2@640x360x2"}) {
    EXPECT_FALSE(wall_from_shorthand(other).has_value()) << other;
  }
}

TEST(WallFile, AnExpandedWallIsTheSameWall) {
  for (const std::string& spec : {test::example_wall("desktop-3x2.toml"), test::example_wall("wall-6x3-4k.toml"),
                                  test::example_wall("cave-4.toml"), test::example_wall("cave-4-stereo.toml"),
                                  std::string("6x3@3840x2160"), std::string("7x3@333x217")}) {
    const Wall wall = load_wall(spec);
    const WallReading again = parse_wall(expand_wall(wall), "expanded");
    ASSERT_TRUE(again.findings.empty()) << spec << ": " << again.findings.front().what;
    EXPECT_EQ(again.wall, wall) << spec;
  }
}

TEST(WallFile, AnExpandedWarpedWallIsTheSameWall) {
  const std::string path = test::example_wall("half-cylinder.toml");
  const Wall wall = load_wall(path);
  ASSERT_TRUE(wall.screens.front().warp.points && wall.screens.front().warp.light);
  const WallReading again = parse_wall(expand_wall(wall), path);
  ASSERT_TRUE(again.findings.empty()) << again.findings.front().what;
  EXPECT_EQ(again.wall, wall);
}

TEST(WallFile, TheHashChangesWithWhatIsSeenAndNotWithComments) {
  const std::uint64_t hash = parse_wall(grid_text("gap_m = [0.010, 0.010]\n"), "t.toml").wall.hash;
  EXPECT_EQ(parse_wall(grid_text("gap_m = [0.010, 0.010] # a comment\n"), "t.toml").wall.hash, hash);
  EXPECT_NE(parse_wall(grid_text("gap_m = [0.010, 0.0101]\n"), "t.toml").wall.hash, hash);
}

TEST(WallFile, TheHashDoesNotChangeWithTheName) {
  const std::string text = grid_text("gap_m = [0.010, 0.010]\n");
  const WallReading reading = parse_wall(text, "t.toml");
  EXPECT_EQ(parse_wall(text, "other.toml").wall.hash, reading.wall.hash);
  EXPECT_EQ(parse_wall("name = \"lobby\"\n" + text, "t.toml").wall.hash, reading.wall.hash);
  EXPECT_NE(parse_wall(text, "other.toml").wall.name, reading.wall.name);
}

TEST(WallFile, AScreenThatCannotBeReadDoesNotMakeItsWindowIdle) {
  const std::string text =
      "hpr_wall = 1\nwindows = [{ id = \"w\" }]\n[[surfaces]]\nid = \"a\"\n[surfaces.grid]\ncolumns = 0\n"
      "rows = 1\ntile_pixels = [64, 36]\ntile_size_m = [0.64, 0.36]\nwindows = [\"w\"]\n";
  EXPECT_NE(errors_of(text), "");
  EXPECT_EQ(warnings_of(text), "");
}

TEST(WallFile, AScaledWallKeepsItsMetres) {
  const Wall wall = scale_wall(load_wall(test::example_wall("wall-6x3-4k.toml")), 0.0625);
  EXPECT_EQ(wall.screens[17].pixels, (Size{240, 135}));
  EXPECT_EQ(wall.screens[17].viewport, (Rect{0, 0, 240, 135}));
  EXPECT_EQ(wall.windows[1].rect, (Rect{240, 0, 480, 135}));
  EXPECT_NEAR(screen_width(wall.screens[17]), 1.2096, 1e-12);
  EXPECT_EQ(scale_wall(wall, 1e-9).screens[0].pixels, (Size{1, 1}));
  EXPECT_THROW(static_cast<void>(scale_wall(wall, 0.0)), Error);
}

}  // namespace
}  // namespace hpr
