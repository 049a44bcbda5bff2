#include "walls/geometry/warp.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <glm/geometric.hpp>
#include <limits>

#include "core/error.h"
#include "core/file.h"
#include "image/image_io.h"
#include "walls/config/wall_file.h"
#include "walls/drawing/panel_transform.h"
#include "walls/geometry/warp_test_tools.h"
#include "walls/geometry/warping.h"

namespace hpr {
namespace {

constexpr std::string_view kIdentity = "x,y,u,v\n0,1,0,1\n1,1,1,1\n0,0,0,0\n1,0,1,0\n";

/// Levels that jump from pixel to pixel, so that any misplaced one shows.
Image<Rgba8> noise(Size size) {
  Image<Rgba8> image(size);
  std::uint32_t state = 1;
  for (Rgba8& pixel : image.pixels()) {
    state = state * 1664525U + 1013904223U;
    pixel = from_word(state | 0xFF000000U);
  }
  return image;
}

Wall wall_of(const WarpMesh& mesh, Size pixels) {
  Wall wall = load_wall(fmt::format("1x1@{}x{}", pixels.width, pixels.height));
  wall.screens.front().warp.grid = std::make_shared<const WarpMesh>(mesh);
  return wall;
}

std::string what_of(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::BadInput);
    EXPECT_FALSE(error.hint().empty());
    return error.what();
  }
  return "nothing wrong";
}

TEST(WarpMesh, TheIdentityIsSentTheSameBits) {
  for (const Size size : {Size{1, 1}, Size{7, 5}, Size{640, 361}}) {
    const Image<Rgba8> picture = noise(size);
    const PanelTransform csv(wall_of(parse_warp_csv(kIdentity, "m.csv"), size), 0);
    EXPECT_FALSE(csv.is_identity());
    EXPECT_EQ(csv.apply(picture), picture);
    const WarpMesh quad =
        parse_warp_obj("v 0 0\nv 1 0\nv 1 1\nv 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n", "m");
    EXPECT_EQ(PanelTransform(wall_of(quad, size), 0).apply(picture), picture);
    const WarpMesh marked = parse_warp_csv(
        "\xEF\xBB\xBF"
        "0;1;0;1\r\n1;1;1;1\r\n0;0;0;0\r\n1;0;1;0\r\n",
        "m.csv");
    EXPECT_EQ(PanelTransform(wall_of(marked, size), 0).apply(picture), picture);
  }
}

TEST(WarpMesh, ManyRowsOfTheIdentityAreTheIdentity) {
  std::string text;
  for (int y = 0; y <= 13; ++y) {
    for (int x = 0; x <= 17; ++x) text += fmt::format("{0},{1},{0},{1}\n", x / 17.0, y / 13.0);
  }
  const Image<Rgba8> picture = noise({333, 217});
  EXPECT_EQ(PanelTransform(wall_of(parse_warp_csv(text, "m.csv"), picture.size()), 0).apply(picture), picture);
}

TEST(WarpMesh, AShiftedMeshShowsWhatItSaysAndNothingBeside) {
  // The screen's left three quarters show the picture from a quarter on, up by an eighth.
  const WarpMesh mesh = parse_warp_csv("0,1,0.25,0.875\n0.75,1,1,0.875\n0,0.125,0.25,0\n0.75,0.125,1,0\n", "m.csv");
  const Image<Rgba8> picture = noise({64, 32});
  const Image<Rgba8> sent = PanelTransform(wall_of(mesh, picture.size()), 0).apply(picture);
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 64; ++x) {
      const bool inside = x < 48 && y < 28;
      EXPECT_EQ(sent.at(x, y), inside ? picture.at(x + 16, y + 4) : (Rgba8{0, 0, 0, 255})) << x << ", " << y;
    }
  }
}

TEST(WarpMesh, BetweenPixelsLightIsMixedLinearly) {
  Image<Rgba8> picture({2, 1}, {0, 0, 0, 255});
  picture.at(1, 0) = {255, 255, 255, 255};
  for (const double part : {0.25, 0.5, 0.9}) {
    const Image<SourcePosition> sources({1, 1}, source_position(0.5 + part, 0.5, picture.size()));
    const auto light = static_cast<float>(std::llround(part * 65536.0)) / 65536.0F;
    EXPECT_EQ(warped(picture, sources, 1).at(0, 0), to_srgb({light, light, light}));
  }
  EXPECT_EQ(source_position(-3.0, 9.0, {4, 5}), (SourcePosition{0, 4U << 16U}));
  EXPECT_EQ(source_position(65536.0, 0.5, {65536, 1}), (SourcePosition{65535U << 16U, 0}));
}

TEST(WarpMesh, SideBySideEachEyesPictureGoesThroughTheMesh) {
  // Left and right of each picture swap.
  Wall wall = wall_of(parse_warp_csv("0,1,1,1\n1,1,0,1\n0,0,1,0\n1,0,0,0\n", "m.csv"), {16, 4});
  wall.stereo = StereoMode::SideBySide;
  const Image<Rgba8> picture = noise({16, 4});
  const Image<Rgba8> sent = PanelTransform(wall, 0).apply(picture);
  for (int x = 0; x < 8; ++x) {
    EXPECT_EQ(sent.at(x, 2), picture.at(7 - x, 2));
    EXPECT_EQ(sent.at(8 + x, 2), picture.at(15 - x, 2));
  }
}

TEST(WarpMesh, WhatIsWrongIsSaidWithItsLine) {
  const auto csv = [](const std::string& text) { return what_of([&] { (void)parse_warp_csv(text, "m.csv"); }); };
  const auto obj = [](const std::string& text) { return what_of([&] { (void)parse_warp_obj(text, "m.obj"); }); };
  EXPECT_EQ(csv(""), "m.csv:1: no grid of at least two rows of two vertices");
  EXPECT_EQ(csv("0,0,0,0\n1,0,1,0\n"), "m.csv:2: no grid of at least two rows of two vertices");
  EXPECT_EQ(csv("0,0,0\n"), "m.csv:1: 3 values where four are wanted");
  EXPECT_EQ(csv("# note\n0,0,0,0\n\n1,a,1,0\n"), "m.csv:4: 'a' is no number");
  EXPECT_EQ(csv("0,0,0,0\n1,0,1.5,0\n"), "m.csv:2: 1.5 is not from 0 to 1");
  EXPECT_EQ(csv("0,0,nan,0\n"), "m.csv:1: nan is not from 0 to 1");
  EXPECT_EQ(csv("0,0,0,0\n1,0,1,0\n0,1,0,1\n"), "m.csv:3: the last row has 1 vertices of 2");
  EXPECT_NE(csv("0,0,0,0\n1,0,1,0\n0,1,0,1\n0.5,1,0,1\n1,1,0,1\n").find("m.csv:5: a row of 3"), std::string::npos);
  EXPECT_NE(csv("0,0,0,0\n0.5,0,0,0\n1,0,1,0\n0,1,0,1\n1,1,1,1\n0,1,0,1\n").find("m.csv:6: a row of 2"),
            std::string::npos);
  // The second row lies beyond the third.
  EXPECT_EQ(csv("0,0,0,0\n1,0,1,0\n0,1,0,1\n1,1,1,1\n0,0.5,0,1\n1,0.5,1,1\n"),
            "m.csv:3: the mesh folds over at 0, 1 of the screen");
  EXPECT_EQ(csv("0,0,0,0\n1,0,1,0\n0,0,0,1\n1,0,1,1\n"), "m.csv:1: the mesh covers nothing of the screen");
  EXPECT_EQ(obj("v 0 0\n"), "m.obj:1: there are no faces");
  EXPECT_EQ(obj("v 0 0\nvt 0 0\nf 1/1 1/1 2/1\n"), "m.obj:3: index 2 of the 1 there are so far");
  EXPECT_EQ(obj("v 0 0\nvt 0 0\nf 1 1 1\n"), "m.obj:3: a corner of a face has no vt");
  EXPECT_EQ(obj("v 0 0\nvt 0 0\nf 1/1 1/x 1/1\n"), "m.obj:3: 'x' is no index");
  EXPECT_EQ(obj("v 0 0\nvt 0 0\nf 1/1 0/1 1/1\n"), "m.obj:3: index 0 of the 1 there are so far");
  EXPECT_EQ(obj("v 0\n"), "m.obj:1: two numbers are wanted");
}

TEST(LevelTable, RoundsAsTheFormulaDoes) {
  const LevelTable table([](float light) { return static_cast<double>(encode_srgb(light)); });
  for (int i = -10; i <= 40'010; ++i) {
    const float light = static_cast<float>(i) / 40'000.0F;
    ASSERT_EQ(table(light), to_srgb({light, 0.0F, 0.0F}).r) << light;
  }
  for (int level = 0; level < 256; ++level) EXPECT_EQ(table(srgb_to_linear(static_cast<std::uint8_t>(level))), level);
  EXPECT_EQ(table(std::numeric_limits<float>::quiet_NaN()), 0);
  EXPECT_EQ(table(std::numeric_limits<float>::infinity()), 255);
}

TEST(PositionMap, ReadsRowsFromTheBottomUpInEitherByteOrder) {
  const Image<glm::vec3> points = test::Arc{}.points({5, 3});
  std::vector<std::byte> bytes = test::pfm(points);
  EXPECT_EQ(parse_position_map(bytes, "m.pfm").points(), points);
  const std::size_t texels = 5 * 3 * 12;
  std::vector<std::byte> other = test::pfm(points);
  other[other.size() - texels - 5] = std::byte{'+'};
  for (std::size_t i = other.size() - texels; i < other.size(); i += 4) std::reverse(&other[i], &other[i] + 4);
  EXPECT_EQ(what_of([&] { (void)parse_position_map(other, "m.pfm"); }), "m.pfm: a header that is no PFM's");
  other[other.size() - texels - 5] = std::byte{'0'};
  EXPECT_EQ(parse_position_map(other, "m.pfm").points(), points);
}

TEST(PositionMap, WhatIsWrongIsSaid) {
  const auto of = [](std::vector<std::byte> bytes) {
    return what_of([&] { (void)parse_position_map(bytes, "m.pfm"); });
  };
  const auto text = [&](std::string_view words) {
    const auto bytes = std::as_bytes(std::span(words));
    return of({bytes.begin(), bytes.end()});
  };
  EXPECT_EQ(text(""), "m.pfm: no PFM");
  EXPECT_EQ(text("P6\n1 1\n255\n"), "m.pfm: no PFM");
  EXPECT_EQ(text("Pf\n1 1\n-1\n"), "m.pfm: a PFM of one channel");
  EXPECT_EQ(text("PF\n1 x\n-1\n"), "m.pfm: a header that is no PFM's");
  EXPECT_EQ(text("PF\n1 1\n0\n"), "m.pfm: a header that is no PFM's");
  EXPECT_EQ(text("PF\n0 1\n-1\n"), "m.pfm: 0 x 1 texels; it may have 1 to 65536 a side");
  EXPECT_EQ(text("PF\n70000 1\n-1\n"), "m.pfm: 70000 x 1 texels; it may have 1 to 65536 a side");
  EXPECT_EQ(text("PF\n65536 65536\n-1\nabc"),
            "m.pfm: 3 bytes after the header, and 65536 x 65536 texels take 51539607552");
  Image<glm::vec3> points({2, 1}, glm::vec3(std::numeric_limits<float>::quiet_NaN()));
  EXPECT_EQ(of(test::pfm(points)), "m.pfm: no texel is a point: all are NaN or infinite");
  points.at(1, 0) = {0.0F, -2e6F, 0.0F};
  EXPECT_NE(of(test::pfm(points)).find("a point at 2"), std::string::npos);
}

/// A wall file in a folder of its own, beside what its screen's warp names.
class WarpFiles : public ::testing::Test {
 protected:
  WarpFiles() : folder_(std::filesystem::temp_directory_path() / fmt::format("hpr-warp-files-{}", ::getpid())) {
    std::filesystem::create_directories(folder_);
  }
  ~WarpFiles() override {
    std::error_code error;
    std::filesystem::remove_all(folder_, error);
  }

  void write_map(const std::string& name, const test::Arc& arc, Size size = {12, 8}) const {
    write_file_atomically(folder_ / name, test::pfm(arc.points(size)));
  }

  /// Findings about a screen of 2 m x 1.25 m before the viewer, on a line each, and what the wall is then.
  [[nodiscard]] std::string findings_of(const std::string& warp, bool viewer = true) {
    const std::string text = fmt::format(
        "hpr_wall = 1\n{}[[surfaces]]\nscreens = [{{ id = \"a\", pixels = [160, 100], corners_m = {{ ll = [-1, 0, -2], "
        "lr "
        "= [1, 0, -2], ul = [-1, 1.25, -2] }}, warp = {} }}]\n",
        viewer ? "viewers = [{ position_m = [0, 1, 0] }]\n" : "", warp);
    WallReading reading = parse_wall(text, (folder_ / "wall.toml").string());
    wall_ = std::move(reading.wall);
    std::string all;
    for (const WallFinding& finding : reading.findings) {
      all += (finding.error ? "error " : "warning ") +
             finding.what.substr(finding.what.find("wall.toml:") + std::string("wall.toml:").size()) + "\n";
    }
    return all;
  }

  std::filesystem::path folder_;
  Wall wall_;
};

TEST_F(WarpFiles, AreFoundBesideTheWallFileAndHeld) {
  write_map("m.pfm", {});
  write_file_atomically(folder_ / "m.csv", kIdentity);
  write_png(folder_ / "alpha.png", Image<Rgba8>({8, 5}, {51, 102, 255, 255}));
  EXPECT_EQ(findings_of("{ mesh = \"m.pfm\", blend = \"alpha.png\", black = \"alpha.png\" }"), "");
  const ScreenWarp warp = wall_.screens.front().warp;
  ASSERT_TRUE(warp.points && warp.light && warp.floor && !warp.grid);
  EXPECT_EQ(warp.points->points(), test::Arc{}.points({12, 8}));
  EXPECT_FLOAT_EQ(warp.light->at(3, 3).r, 0.2F);
  EXPECT_FLOAT_EQ(warp.floor->at(3, 3).g, 0.4F);
  EXPECT_EQ(warp.light->at(3, 3).b, 1.0F);
  const std::uint64_t hash = wall_.hash;
  EXPECT_EQ(findings_of("{ mesh = \"m.csv\" }"), "");
  EXPECT_TRUE(wall_.screens.front().warp.grid && !wall_.screens.front().warp.points);
  EXPECT_NE(wall_.hash, hash);
  EXPECT_NE(wall_.screens.front().warp, warp);
}

TEST_F(WarpFiles, WhatLooksWrongIsAWarning) {
  write_map("mirrored.pfm", {.left = 40.0, .right = -40.0});
  EXPECT_EQ(findings_of("{ mesh = \"mirrored.pfm\" }"),
            "warning 4:124: the points of screen \"a\" are in mirror image as the viewer sees them\n");
  write_map("upside-down.pfm", {.bottom = 3.0, .top = 0.0});
  EXPECT_NE(findings_of("{ mesh = \"upside-down.pfm\" }").find("in mirror image"), std::string::npos);
  write_map("round.pfm", {.left = -100.0, .right = 100.0});
  EXPECT_EQ(
      findings_of("{ mesh = \"round.pfm\" }"),
      "warning 4:124: 16 of 96 points of screen \"a\" lie behind the viewer's eye, or 85 degrees and more off its "
      "normal\n");
  Image<glm::vec3> folded = test::Arc{}.points({12, 8});
  std::swap(folded.at(5, 4), folded.at(6, 4));
  write_file_atomically(folder_ / "folded.pfm", test::pfm(folded));
  EXPECT_NE(findings_of("{ mesh = \"folded.pfm\" }").find("warning 4:124: the points of screen \"a\" fold over, in "),
            std::string::npos);
  write_map("tall.pfm", {}, {64, 80});
  EXPECT_EQ(findings_of("{ mesh = \"tall.pfm\" }"),
            "warning 4:133: 'mesh' of warp has 64 x 80 pixels, another shape than the screen's 160 x 100\n");
}

TEST_F(WarpFiles, WhatCannotBeUsedIsAnError) {
  write_map("m.pfm", {});
  write_map("behind.pfm", {.left = 140.0, .right = 220.0});
  EXPECT_EQ(findings_of("{ mesh = \"m.pfm\" }", false),
            "error 3:124: screen \"a\" has a position map, and no viewer a place\n");
  EXPECT_NE(findings_of("{ mesh = \"behind.pfm\" }").find("error 4:124: all points of screen \"a\" lie behind"),
            std::string::npos);
  EXPECT_EQ(findings_of("{ }"), "error 4:124: warp names no file\n");
  EXPECT_EQ(findings_of("{ mesh = \"m.ply\" }").substr(0, 47), "error 4:133: 'mesh' of warp cannot be used: can");
  write_file_atomically(folder_ / "m.ply", "ply\n");
  EXPECT_EQ(findings_of("{ mesh = \"m.ply\" }"), "error 4:133: 'mesh' of warp is \"m.ply\", of no known kind\n");
  EXPECT_EQ(findings_of("{ mesh = \"\" }"), "error 4:133: 'mesh' of warp is \"\"\n");
  Image<Rgb> bright({2, 2}, {1.0F, 1.0F, 1.5F});
  write_file_atomically(folder_ / "bright.exr", encode_exr(bright, {}));
  EXPECT_EQ(findings_of("{ blend = \"bright.exr\" }"), "error 4:134: 'blend' of warp holds 1.5\n");
}

TEST(PanelTransform, AWarpsBlendAndBlackChangeLinearLight) {
  Wall wall = load_wall("1x1@4x2");
  ScreenWarp& warp = wall.screens.front().warp;
  Image<Rgb> light({4, 2}, {1.0F, 1.0F, 1.0F});
  light.at(1, 0) = {0.5F, 0.25F, 0.0F};
  warp.light = std::make_shared<const Image<Rgb>>(light);
  Image<Rgb> floor({4, 2});
  floor.at(2, 1) = {0.1F, 0.1F, 0.1F};
  warp.floor = std::make_shared<const Image<Rgb>>(floor);
  const Image<Rgba8> picture = noise({4, 2});
  const Image<Rgba8> sent = PanelTransform(wall, 0).apply(picture);
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 4; ++x) {
      const Rgba8 before = picture.at(x, y);
      Rgb linear{srgb_to_linear(before.r), srgb_to_linear(before.g), srgb_to_linear(before.b)};
      if (x == 1 && y == 0) linear = {0.5F * linear.r, 0.25F * linear.g, 0.0F};
      if (x == 2 && y == 1) linear = {0.1F + 0.9F * linear.r, 0.1F + 0.9F * linear.g, 0.1F + 0.9F * linear.b};
      EXPECT_EQ(sent.at(x, y), to_srgb(linear)) << x << ", " << y;
    }
  }
  PanelColor color;
  color.black = glm::dvec3(0.5);
  EXPECT_NEAR(panel_level(color, 0, 0.5, 1.0, 0.2), encode_srgb(0.6F + 0.4F * 0.5F), 1e-6);
}

TEST(PanelTransform, WhereNoLightFallsNothingIsSentWhateverTheFloor) {
  Wall mesh = wall_of(parse_warp_csv("0,1,0,1\n0.5,1,1,1\n0,0,0,0\n0.5,0,1,0\n", "m.csv"), {4, 2});
  Image<glm::vec3> points = test::Arc{}.points({4, 2});
  for (int y = 0; y < 2; ++y) points.at(2, y) = points.at(3, y) = glm::vec3(std::numeric_limits<float>::infinity());
  Wall map = load_wall("1x1@4x2");
  map.screens.front().warp.points = std::make_shared<const PositionMap>(points);
  for (Wall* const wall : {&mesh, &map}) {
    WallScreen& screen = wall->screens.front();
    screen.color.black = glm::dvec3(0.2);
    screen.warp.floor = std::make_shared<const Image<Rgb>>(Size{1, 1}, Rgb{0.5F, 0.5F, 0.5F});
    const Image<Rgba8> sent = PanelTransform(*wall, 0).apply(Image<Rgba8>({4, 2}, {0, 0, 0, 255}));
    EXPECT_EQ(sent.at(1, 0), to_srgb({0.6F, 0.6F, 0.6F}));
    EXPECT_EQ(sent.at(2, 1), (Rgba8{0, 0, 0, 255}));
  }
}

TEST(PanelTransform, AMapOfFewerPixelsIsBroughtToTheScreens) {
  Wall wall = load_wall("1x1@64x2");
  Image<Rgb> light({2, 1});
  light.at(1, 0) = {1.0F, 1.0F, 1.0F};
  wall.screens.front().warp.light = std::make_shared<const Image<Rgb>>(light);
  const Image<Rgba8> sent = PanelTransform(wall, 0).apply(Image<Rgba8>({64, 2}, {255, 255, 255, 255}));
  EXPECT_EQ(sent.at(0, 0).r, 0);
  EXPECT_EQ(sent.at(63, 1).r, 255);
  for (int x = 16; x < 48; ++x) {
    const auto expected = static_cast<float>((x + 0.5 - 16.0) / 32.0);
    EXPECT_EQ(sent.at(x, 0).g, to_srgb({expected, expected, expected}).g) << x;
  }
}

}  // namespace
}  // namespace hpr
