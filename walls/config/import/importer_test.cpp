#include "walls/config/import/importer.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "walls/config/wall_file.h"
#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

Wall imported(const std::string& text, const std::string& kind, const ImportSettings& settings = {}) {
  const WallReading reading = parse_wall(import_wall(text, "file", kind, settings), "imported.toml");
  EXPECT_TRUE(reading.ok());
  return reading.wall;
}

/// What importing this fails with, and the line it shows.
std::pair<std::string, std::string> failure(const std::string& text, const std::string& kind) {
  try {
    static_cast<void>(import_wall(text, "file", kind, {}));
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::BadInput);
    EXPECT_FALSE(error.hint().empty());
    return {error.what(), error.line()};
  }
  ADD_FAILURE() << "imported";
  return {};
}

constexpr const char* kDisplayCluster = R"(<?xml version="1.0" ?>
<configuration>
  <dimensions numTilesWidth="2" numTilesHeight="2" screenWidth="2560" screenHeight="1600" mullionWidth="90"
              mullionHeight="110" fullscreen="1" />
  <process host="tile-0-1" display=":0.0">
    <screen x="0" y="0" i="0" j="0" />
    <screen x="0" y="1600" i="0" j="1" />
  </process>
  <process host="tile-0-2" display=":0.1">
    <screen x="5" y="7" i="1" j="0" />
  </process>
</configuration>
)";

TEST(ImportDisplayCluster, MullionsBecomeMetresAndProcessesHosts) {
  const Wall wall = imported(kDisplayCluster, "displaycluster", {.pitch_m = 0.0005});
  ASSERT_EQ(wall.screens.size(), 4U);
  EXPECT_EQ(wall.screens[0].pixels, (Size{2560, 1600}));
  EXPECT_NEAR(screen_width(wall.screens[0]), 1.28, 1e-12);
  EXPECT_NEAR(wall.screens[1].lower_left.x - wall.screens[0].lower_right.x, 0.045, 1e-12);
  EXPECT_NEAR(wall.screens[0].lower_left.y - wall.screens[2].upper_left.y, 0.055, 1e-12);
  ASSERT_EQ(wall.nodes.size(), 2U);
  EXPECT_EQ(wall.nodes[1].host, "tile-0-2");
  EXPECT_EQ(wall.screens[2].node, "n0") << "row 1 is below";
  EXPECT_EQ(wall.screens[1].node, "n1");
  EXPECT_EQ(wall.screens[3].window, "") << "driven by no process";
  ASSERT_EQ(wall.windows.size(), 3U);
  EXPECT_EQ(wall.windows[2].rect, (Rect{5, 7, 2565, 1607}));
  EXPECT_EQ(wall.windows[2].display, ":0.1");
  EXPECT_TRUE(wall.windows[2].fullscreen);
}

TEST(ImportDisplayCluster, SaysWhatWasAssumed) {
  const std::string toml = import_wall(kDisplayCluster, "stallion.xml", "displaycluster", {});
  EXPECT_NE(toml.find("# From stallion.xml (displaycluster).\n"), std::string::npos);
  EXPECT_NE(toml.find("# The file counts in pixels: metres are pixels times 0.25 mm."), std::string::npos);
  EXPECT_NE(toml.find("# 1 of 4 places of the grid are driven by no process"), std::string::npos);
}

TEST(ImportDisplayCluster, WrongFilesAreToldWithTheirLine) {
  std::string text = kDisplayCluster;
  text.replace(text.find("i=\"1\""), 5, "i=\"2\"");
  EXPECT_EQ(failure(text, "displaycluster"),
            (std::pair<std::string, std::string>("file:10: i is '2'", R"(    <screen x="5" y="7" i="2" j="0" />)")));
  text = kDisplayCluster;
  text.replace(text.find("j=\"1\""), 5, "j=\"0\"");
  EXPECT_EQ(failure(text, "displaycluster").first, "file:7: tile i 0, j 0 is driven twice");
  text = kDisplayCluster;
  text.erase(text.find("</process>"), 10);
  EXPECT_TRUE(failure(text, "displaycluster").first.starts_with("file:")) << failure(text, "displaycluster").first;
  EXPECT_NE(failure(text, "displaycluster").first.find("it is no XML"), std::string::npos);
  EXPECT_EQ(failure("<pvx/>", "displaycluster").first, "file:1: <pvx> stands where <configuration> was expected");
  EXPECT_EQ(failure("<configuration/>", "displaycluster").first, "file:1: <configuration> has no <dimensions>");
}

constexpr const char* kCave = R"(<?xml version="1.0" ?>
<pvx>
  <Process Type="client" />
  <Process Type="server">
    <EyeSeparation Value="0.065"/>
    <Machine Name="left" Environment="FOO=1 DISPLAY=left:0.1" Geometry="1200x1200+10+20"
             LowerLeft="-1 -1 1" LowerRight="-1 -1 -1" UpperRight="-1 1 -1" />
    <Machine Name="front" LowerLeft="-1.5 -1 -1" LowerRight="1.5 -1 -1" UpperLeft="-1.5 1 -1" />
  </Process>
</pvx>
)";

TEST(ImportParaView, CornersAndWindowsOfACave) {
  const Wall wall = imported(kCave, "paraview");
  ASSERT_EQ(wall.screens.size(), 2U);
  EXPECT_EQ(wall.screens[0].upper_left, glm::dvec3(-1, 1, 1));
  EXPECT_EQ(wall.screens[0].pixels, (Size{1200, 1200}));
  EXPECT_EQ(wall.windows[0].rect, (Rect{10, 20, 1210, 1220}));
  EXPECT_EQ(wall.windows[0].display, "left:0.1");
  EXPECT_EQ(wall.screens[1].upper_left, glm::dvec3(-1.5, 1, -1)) << "older files have the upper left corner";
  EXPECT_EQ(wall.screens[1].pixels, (Size{1620, 1080})) << "square pixels, as high as --pixels says";
  EXPECT_EQ(wall.nodes[1].host, "front");
  EXPECT_TRUE(wall.viewers.front().has_position);
  EXPECT_EQ(wall.viewers.front().position, glm::dvec3(0));
}

TEST(ImportParaView, TilesAndMullionsRowByRow) {
  const Wall wall = imported(R"(<pvx><Process Type="server|dataserver|renderserver">
      <Option Name="tile-dimensions-x" Value="2"/><Option Name="tile-dimensions-y" Value="2"/>
      <Option Name="tile-mullion-x" Value="20"/>
      <Machine Name="a"/><Machine Name="b"/><Machine Name="c"/><Machine Name="a" Environment="DISPLAY=:0.1"/>
      </Process></pvx>)",
                             "pvx", {.pixels = {1000, 500}, .pitch_m = 0.001});
  ASSERT_EQ(wall.screens.size(), 4U);
  EXPECT_EQ(wall.screens[0].pixels, (Size{1000, 500}));
  EXPECT_NEAR(wall.screens[1].lower_left.x - wall.screens[0].lower_right.x, 0.020, 1e-12);
  EXPECT_NEAR(wall.screens[0].lower_left.y - wall.screens[2].upper_left.y, 0.0, 1e-12);
  EXPECT_EQ(wall.screens[2].node, "n2");
  EXPECT_EQ(wall.screens[3].node, "n0");
  EXPECT_EQ(wall.nodes[0].ranks, 2);
  EXPECT_FALSE(wall.viewers.front().has_position);
}

TEST(ImportParaView, MachinesWithoutNamesAreHostsOfTheirOwn) {
  const Wall wall = imported(R"(<pvx>
      <Machine Geometry="64x64+0+0" LowerLeft="0 0 0" LowerRight="1 0 0" UpperRight="1 1 0"/>
      <Machine Geometry="64x64+0+0" LowerLeft="1 0 0" LowerRight="2 0 0" UpperRight="2 1 0"/></pvx>)",
                             "paraview");
  ASSERT_EQ(wall.nodes.size(), 2U);
  EXPECT_EQ(wall.nodes[1].host, "*");
}

TEST(ImportParaView, WrongFilesAreToldWithTheirLine) {
  std::string text = kCave;
  text.replace(text.find("1200x1200+10+20"), 15, "1200*1200");
  EXPECT_EQ(failure(text, "paraview").first, "file:6: Geometry is '1200*1200'");
  text = kCave;
  text.replace(text.find("-1.5 -1 -1"), 10, "-1.5 -1 xx");
  EXPECT_EQ(failure(text, "paraview").first, "file:8: LowerLeft is '-1.5 -1 xx', not three numbers");
  text = kCave;
  text.replace(text.find(" UpperLeft"), 22, "");
  EXPECT_EQ(failure(text, "paraview").first, "file:8: the machine has no LowerLeft, LowerRight and UpperRight");
  EXPECT_EQ(failure("<pvx/>", "paraview").first, "file:1: it tells of no machine and no tile");
  text = kCave;
  text.replace(text.find("UpperLeft=\"-1.5 1 -1\""), 21, "UpperLeft=\"0.5 1 -1\"");
  EXPECT_NE(failure(text, "paraview").first.find("(imported)"), std::string::npos) << "a slanted screen";
}

constexpr const char* kTide = R"({
  "master": {"host": "localhost"},
  "processes": [
    {"host": "a", "screens": [{"display": ":0.2", "fullscreen": true, "i": 0, "j": 0, "x": 0, "y": 0}]},
    {"host": "b", "screens": [{"display": ":0.0", "i": 1, "stereo": "left", "y": 40},
                              {"display": ":0.0", "i": 1, "stereo": "right", "y": 40}]}
  ],
  "surfaces": [{"bezelHeight": 12, "bezelWidth": 14, "displayHeight": 1080, "displayWidth": 1920,
                "displaysPerScreenX": 2, "displaysPerScreenY": 1, "numScreensX": 2, "numScreensY": 1}]
}
)";

TEST(ImportTide, AScreenOfTwoDisplaysIsOneWindow) {
  const Wall wall = imported(kTide, "tide", {.pitch_m = 0.001});
  ASSERT_EQ(wall.screens.size(), 4U);
  ASSERT_EQ(wall.windows.size(), 2U);
  EXPECT_EQ(wall.windows[0].rect, (Rect{0, 0, 3854, 1080}));
  EXPECT_EQ(wall.screens[1].viewport, (Rect{1934, 0, 3854, 1080})) << "the bezel is part of the window";
  for (std::size_t i = 1; i < 4; ++i) {
    EXPECT_NEAR(wall.screens[i].lower_left.x - wall.screens[i - 1].lower_right.x, 0.014, 1e-12);
  }
  EXPECT_EQ(wall.screens[3].node, "n1");
  EXPECT_TRUE(wall.windows[0].fullscreen);
  const std::string toml = import_wall(kTide, "file", "tide", {});
  EXPECT_NE(toml.find("# 1 screens of the right eye were left out."), std::string::npos);
  EXPECT_NE(toml.find("left out: master."), std::string::npos);
}

TEST(ImportTide, PhysicalDimensionsGiveThePitch) {
  std::string text = kTide;
  text.insert(text.find("\"bezelHeight\""), "\"dimensions\": [7.722, 1.08], ");
  EXPECT_NEAR(screen_width(imported(text, "tide").screens[0]), 1.92, 1e-9);
}

TEST(ImportTide, SeveralSurfacesStandSideBySide) {
  const Wall wall = imported(R"({"surfaces": [{"displayWidth": 400, "displayHeight": 300, "screenCountX": 1,
      "screenCountY": 1}, {"displayWidth": 40, "displayHeight": 30, "screenCountX": 1, "screenCountY": 2}]})",
                             "tide", {.pitch_m = 0.01});
  ASSERT_EQ(wall.screens.size(), 3U);
  EXPECT_NEAR(wall.screens[1].lower_left.x - wall.screens[0].lower_right.x, 1.0, 1e-12);
  EXPECT_EQ(wall.screens[2].surface, "surface1");
}

TEST(ImportTide, WrongFilesAreToldWithTheirPlace) {
  std::string text = kTide;
  text.replace(text.find("\"i\": 1"), 6, "\"i\": 2");
  EXPECT_EQ(failure(text, "tide").first, "file: /processes/1/screens/0/i: it is 2");
  text = kTide;
  text.replace(text.find("\"i\": 1"), 6, "\"i\": 0");
  EXPECT_EQ(failure(text, "tide").first, "file: /processes/1/screens/0: screen i 0, j 0 is driven twice");
  text = kTide;
  text.replace(text.find("\"a\","), 4, "\"a\";");
  EXPECT_EQ(failure(text, "tide").first, "file:4: it is no JSON");
  EXPECT_TRUE(failure(text, "tide").second.starts_with("    {\"host\": \"a\";"));
  EXPECT_EQ(failure("[]", "tide").first, "file: /: it is no object");
  EXPECT_EQ(failure("{}", "tide").first, "file: /: it has no \"surfaces\"");
  EXPECT_EQ(failure(R"({"surfaces": [{"displayWidth": 1e300}]})", "tide").first,
            "file: /surfaces/0: it has no \"numScreensX\"");
}

constexpr const char* kOspray = R"([
  {"hostName": "localhost", "topLeft": [-2, 1, 0], "botLeft": [-2, -1, 0], "botRight": [2, -1, 0],
   "eye": [0, 0, 2], "display": 0, "screenWidth": 800, "screenHeight": 400, "showUI": true},
  {"hostName": "r07", "topLeft": [-1.887851, 1.078200, 0.613400], "botLeft": [-1.887851, 0.359400, 0.613400],
   "botRight": [-1.887851, 0.359400, -0.613400], "eye": [0, 0, 0.5],
   "mullionLeft": 0.011326, "mullionRight": 0.012, "mullionTop": 0.020733, "mullionBottom": 0.02,
   "display": 1, "screenX": 30, "screenY": 40, "screenWidth": 3840, "screenHeight": 2160}
]
)";

TEST(ImportOspray, MullionsShrinkTheScreen) {
  const Wall wall = imported(kOspray, "ospray");
  ASSERT_EQ(wall.screens.size(), 1U) << "the user interface is no screen of the wall";
  const WallScreen& screen = wall.screens[0];
  EXPECT_NEAR(screen_width(screen), 2 * 0.6134 - 0.011326 - 0.012, 1e-12);
  EXPECT_NEAR(screen_height(screen), 1.0782 - 0.3594 - 0.020733 - 0.02, 1e-12);
  EXPECT_NEAR(screen.lower_left.y, 0.3594 + 0.02, 1e-12);
  EXPECT_NEAR(screen.lower_left.z, 0.6134 - 0.011326, 1e-12);
  EXPECT_EQ(wall.windows[0].rect, (Rect{30, 40, 3870, 2200}));
  EXPECT_EQ(wall.nodes[0].host, "r07");
  EXPECT_TRUE(wall.viewers.front().has_position);
  EXPECT_EQ(wall.viewers.front().position, glm::dvec3(0, 0, 0.5));
}

TEST(ImportOspray, CornersOfFewDigitsAreMadeSquare) {
  const Wall wall = imported(R"([{"topLeft": [0.0001, 1, 0], "botLeft": [0, 0, 0], "botRight": [1, 0, 0],
      "screenWidth": 64, "screenHeight": 64}])",
                             "osprstudio");
  EXPECT_EQ(wall.screens[0].upper_left, glm::dvec3(0, 1, 0));
}

TEST(ImportOspray, WrongFilesAreToldWithTheirPlace) {
  EXPECT_EQ(failure(R"([{"topLeft": [0, 1]}])", "ospray").first, "file: /0/topLeft: it is not three numbers");
  std::string text = kOspray;
  text.replace(text.find("3840"), 4, "38.5");
  EXPECT_EQ(failure(text, "ospray").first, "file: /1/screenWidth: it is 38.5");
  text = kOspray;
  text.replace(text.find("0.020733"), 8, "0.9");
  EXPECT_EQ(failure(text, "ospray").first, "file: /1/mullionTop: it is 0.9");
  EXPECT_EQ(failure("{}", "ospray").first, "file: /: it is no list of screens");
}

TEST(Importers, UnknownKindsListTheChoices) {
  try {
    static_cast<void>(import_wall("", "file", "paravew", {}));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Usage);
    EXPECT_NE(error.hint().find("did you mean 'paraview'?"), std::string::npos);
    EXPECT_NE(error.hint().find("osprstudio"), std::string::npos);
  }
}

TEST(Importers, WindowsOnOneAnotherLoseTheirPlaces) {
  const std::string tide =
      R"({"surfaces": [{"displayWidth": 40, "displayHeight": 30, "numScreensX": 2, "numScreensY": 1}],
      "processes": [{"host": "a", "screens": [{"i": 0}, {"i": 1}]}]})";
  const Wall wall = imported(tide, "tide");
  EXPECT_EQ(wall.windows[0].rect, (Rect{0, 0, 40, 30}));
  EXPECT_TRUE(wall.windows[1].rect.empty());
  EXPECT_NE(import_wall(tide, "file", "tide", {}).find("their places were left out: wall-w0-1."), std::string::npos);
}

TEST(Importers, TilesWithoutGeometryHaveNoPlaces) {
  const Wall wall = imported(R"(<pvx><Option Name="tile-dimensions-x" Value="2"/><Machine Name="localhost"/>
      <Machine Name="localhost"/></pvx>)",
                             "paraview");
  EXPECT_TRUE(wall.windows[0].rect.empty());
  EXPECT_EQ(wall.nodes[0].ranks, 2);
}

/// Prefixes, and bytes replaced by ones that mean something: told or imported, nothing else.
TEST(Importers, DamagedFilesDoNoHarm) {
  const std::vector<std::pair<std::string, std::string>> files{
      {kDisplayCluster, "displaycluster"}, {kCave, "paraview"}, {kTide, "tide"}, {kOspray, "ospray"}};
  for (const auto& [text, kind] : files) {
    const auto harmless = [&](const std::string& damaged) {
      try {
        static_cast<void>(import_wall(damaged, "file", kind, {}));
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ExitCode::BadInput) << error.what();
      }
    };
    for (std::size_t at = 0; at < text.size(); at += 7) {
      harmless(text.substr(0, at));
      for (const char with : {'9', '-', '<', '"', '{', '\0'}) {
        std::string damaged = text;
        damaged[at] = with;
        harmless(damaged);
      }
    }
  }
}

}  // namespace
}  // namespace hpr
