#include "walls/drawing/plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "core/error.h"
#include "walls/config/example_walls.h"
#include "walls/config/wall_file.h"
#include "walls/drawing/canvas.h"
#include "walls/drawing/pattern.h"
#include "walls/geometry/geometry.h"

namespace hpr {
namespace {

TEST(WallPlan, NamesEveryScreenWithItsSizesAndOwner) {
  const Wall wall = load_wall(test::example_wall("desktop-3x2.toml"));
  const std::string svg = wall_plan_svg(wall);
  for (const WallScreen& screen : wall.screens) {
    EXPECT_NE(svg.find(">" + screen.id + "</text>"), std::string::npos);
    EXPECT_NE(svg.find(">window " + screen.window + "</text>"), std::string::npos);
  }
  for (const char* const part : {"640 x 360 px", "512 x 288 mm", "pc (localhost), rank 0", "pc (localhost), rank 1",
                                 "6 screens, 1.38 Mpx, 1556 x 586 mm, gaps of 10 mm"}) {
    EXPECT_NE(svg.find(part), std::string::npos) << part;
  }
  EXPECT_TRUE(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
}

TEST(WallPlan, EscapesWhatXmlWouldTakeForMarkup) {
  Wall wall = load_wall("1x1");
  wall.name = "<b>&\"\x01";
  const std::string svg = wall_plan_svg(wall);
  EXPECT_NE(svg.find("&lt;b&gt;&amp;&quot;\\x01"), std::string::npos);
  EXPECT_EQ(svg.find("<b>"), std::string::npos);
}

TEST(WallPlan, ThePictureShowsEachOwnerInAColourOfItsOwn) {
  const Wall wall = load_wall(test::example_wall("desktop-3x2.toml"));
  const Image<Rgba8> image = wall_plan_image(wall);
  const auto has = [&](Rgba8 color) { return std::ranges::count(image.pixels(), color) > 10000; };
  EXPECT_TRUE(has({176, 206, 240, 255}));
  EXPECT_TRUE(has({250, 214, 165, 255}));
  EXPECT_FALSE(has({188, 226, 184, 255}));
}

TEST(WallPlan, WallsOfOneAndOfManyScreensCanBeDrawn) {
  EXPECT_GT(wall_plan_svg(load_wall("1x1@1x1")).size(), 100U);
  EXPECT_GT(wall_plan_svg(load_wall("64x64")).size(), 64U * 64U * 50U);
  EXPECT_GT(wall_plan_svg(load_wall("1x200")).size(), 100U);
  EXPECT_GT(wall_plan_image(load_wall(test::example_wall("cave-4.toml"))).size().area(), 0U);
}

/// The yellow pixels of a screen's pattern, as points of the wall in metres about its centre.
std::vector<glm::dvec2> circle_points(const Wall& wall, std::size_t index) {
  const WallExtent extent = wall_extent(wall);
  const WallScreen& screen = wall.screens[index];
  const Image<Rgba8> image = wall_pattern(wall, index);
  std::vector<glm::dvec2> points;
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      if (image.at(x, y) != Rgba8{255, 210, 0, 255}) continue;
      const glm::dvec3 at = screen.upper_left - extent.center;
      points.emplace_back(at.x + (x + 0.5) * pixel_pitch(screen), at.y - (y + 0.5) * pixel_pitch(screen));
    }
  }
  return points;
}

TEST(WallPattern, TheCircleIsOneCircleAcrossAllScreens) {
  const Wall wall = load_wall(test::example_wall("desktop-3x2.toml"));
  const WallExtent extent = wall_extent(wall);
  const double radius = 0.94 * 0.5 * extent.height;
  std::size_t screens_with_circle = 0;
  for (std::size_t i = 0; i < wall.screens.size(); ++i) {
    const auto points = circle_points(wall, i);
    screens_with_circle += points.empty() ? 0U : 1U;
    // Fully yellow pixels lie inside the line, 2 pixels wide.
    for (const glm::dvec2& p : points) EXPECT_NEAR(glm::length(p), radius, 1.5 * finest_pitch(wall));
  }
  EXPECT_GE(screens_with_circle, 2U);
}

TEST(WallPattern, TheOutermostPixelsAreWhite) {
  const Image<Rgba8> image = wall_pattern(load_wall("2x1@320x200"), 1);
  ASSERT_EQ(image.size(), (Size{320, 200}));
  for (int x = 0; x < 320; ++x) {
    EXPECT_EQ(image.at(x, 0), (Rgba8{255, 255, 255, 255}));
    EXPECT_EQ(image.at(x, 199), (Rgba8{255, 255, 255, 255}));
  }
  for (int y = 0; y < 200; ++y) {
    EXPECT_EQ(image.at(0, y), (Rgba8{255, 255, 255, 255}));
    EXPECT_EQ(image.at(319, y), (Rgba8{255, 255, 255, 255}));
  }
}

TEST(WallPattern, RulersCountMillimetresFromTheLeftAndTheTop) {
  // 640 pixels are 512 mm: a tick every 5 mm, a long one every 50.
  const Image<Rgba8> image = wall_pattern(load_wall(test::example_wall("desktop-3x2.toml")), 0);
  constexpr Rgba8 kWhite{255, 255, 255, 255};
  for (int i = 8; i < 90; ++i) {
    const int at = static_cast<int>(std::lround(i * 5.0 * 640.0 / 512.0));
    EXPECT_EQ(image.at(at, 2), kWhite) << i;
    EXPECT_EQ(image.at(at, 9) == kWhite, i % 10 == 0) << i;
    EXPECT_NE(image.at(at + 3, 2), kWhite) << i;
  }
  for (int i = 8; i < 50; ++i) EXPECT_EQ(image.at(2, static_cast<int>(std::lround(i * 5.0 * 360.0 / 288.0))), kWhite);
}

TEST(WallPattern, ArrowsPointToTheNeighboursThereAre) {
  const Wall wall = load_wall(test::example_wall("desktop-3x2.toml"));
  const auto arrows = [&](std::size_t screen, const Rect& part) {
    const Image<Rgba8> image = wall_pattern(wall, screen);
    std::size_t count = 0;
    for (int y = part.y0; y < part.y1; ++y) {
      for (int x = part.x0; x < part.x1; ++x) count += image.at(x, y) == Rgba8{150, 255, 150, 255} ? 1U : 0U;
    }
    return count;
  };
  constexpr Rect kLeft{0, 80, 100, 130};
  constexpr Rect kRight{540, 80, 640, 130};
  constexpr Rect kBelow{400, 310, 540, 360};
  EXPECT_EQ(arrows(0, kLeft), 0U);
  EXPECT_GT(arrows(0, kRight), 20U);
  EXPECT_GT(arrows(0, kBelow), 20U);
  EXPECT_GT(arrows(4, kLeft), 20U);
  EXPECT_EQ(arrows(4, kBelow), 0U);
}

TEST(WallPlan, OfTwoEyesScreensTheLeftOneIsDrawnLast) {
  Wall wall = load_wall("1x1@1000x600");
  wall.screens.push_back(wall.screens.front());
  wall.screens[0].id = "first-left";
  wall.screens[0].eye = Eye::Left;
  wall.screens[1].id = "then-right";
  wall.screens[1].eye = Eye::Right;
  const std::string svg = wall_plan_svg(wall);
  EXPECT_LT(svg.find("then-right"), svg.find("first-left"));
  EXPECT_NE(svg.find("left eye"), std::string::npos);
}

TEST(WallPattern, AScreenBeyondTheDrawingLimitIsRefusedWithALimitError) {
  try {
    static_cast<void>(wall_pattern(load_wall("1x1@40000x10"), 0));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Limit);
  }
  EXPECT_EQ(wall_pattern(load_wall("1x1@1x1"), 0).size(), (Size{1, 1}));
}

}  // namespace
}  // namespace hpr
