#include "walls/displays/window_plan.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "walls/config/wall_file.h"
#include "walls/drawing/panel_transform.h"

namespace hpr {
namespace {

TEST(WindowPlan, ScreensOfAGridHaveWindowsPlacedAsTheyHang) {
  const Wall wall = load_wall("2x2@40x30");
  const auto plans = plan_windows(wall, {0, 1, 2, 3});
  ASSERT_EQ(plans.size(), 4U);
  for (std::size_t i = 0; i < plans.size(); ++i) {
    EXPECT_EQ(plans[i].title, wall.screens[i].id);
    EXPECT_EQ(plans[i].rect.width(), 40);
    EXPECT_EQ(plans[i].rect.height(), 30);
    ASSERT_EQ(plans[i].panes.size(), 1U);
    EXPECT_EQ(plans[i].panes[0].rect, (Rect{0, 0, 40, 30}));
    EXPECT_TRUE(plans[i].decorated);
  }
  EXPECT_GE(plans[1].rect.x0, plans[0].rect.x1);
  EXPECT_GE(plans[2].rect.y0, plans[0].rect.y1);
}

TEST(WindowPlan, ScreensOfOneWindowShareItAndTurnedOnesAreShownTurned) {
  Wall wall = load_wall("2x1@40x30");
  wall.windows = {{.id = "both", .node = {}, .gpu = {}, .display = ":7", .monitor = {}, .rect = {5, 6, 75, 46}}};
  for (WallScreen& screen : wall.screens) screen.window = "both";
  wall.screens[0].viewport = {0, 0, 40, 30};
  wall.screens[1].rotate = 90;
  wall.screens[1].viewport = {40, 0, 70, 40};
  const auto plans = plan_windows(wall, {0, 1});
  ASSERT_EQ(plans.size(), 1U);
  EXPECT_EQ(plans[0].rect, (Rect{5, 6, 75, 46}));
  EXPECT_EQ(plans[0].display, ":7");
  EXPECT_FALSE(plans[0].decorated);
  ASSERT_EQ(plans[0].panes.size(), 2U);
  EXPECT_EQ(plans[0].panes[1].rect, (Rect{40, 0, 70, 40}));
  EXPECT_EQ(plans[0].panes[1].rotate, 90);
}

TEST(WindowPlan, AWindowCalledAsAScreenWithoutOneHasItsOwnScreensOnly) {
  Wall wall = load_wall("2x1@40x30");
  wall.windows = {
      {.id = wall.screens[0].id, .node = {}, .gpu = {}, .display = {}, .monitor = {}, .rect = {5, 6, 45, 36}}};
  wall.screens[1].window = wall.screens[0].id;
  wall.screens[1].viewport = {0, 0, 40, 30};
  const auto plans = plan_windows(wall, {0, 1});
  ASSERT_EQ(plans.size(), 2U);
  EXPECT_EQ(plans[0].panes.size(), 1U);
  EXPECT_EQ(plans[1].rect, (Rect{5, 6, 45, 36}));
}

TEST(WindowPlan, APlaceIsInThePaneThatCoversIt) {
  WindowPlan plan;
  plan.panes.resize(2);
  plan.panes[0].rect = {0, 0, 40, 30};
  plan.panes[1].rect = {40, 0, 70, 40};
  EXPECT_EQ(pane_at(plan, {39.9, 0.0}), 0U);
  EXPECT_EQ(pane_at(plan, {40.0, 35.0}), 1U);
  EXPECT_EQ(pane_at(plan, {10.0, 35.0}), std::nullopt);
  EXPECT_EQ(pane_at(plan, {-1.0, 0.0}), std::nullopt);
}

/// Where the one bright pixel of a screen's picture is on its panel.
glm::dvec2 on_panel(const Wall& wall, int x, int y) {
  Image<Rgba8> picture(wall.screens[0].pixels);
  picture.at(x, y) = {255, 255, 255, 255};
  const Image<Rgba8> sent = PanelTransform(wall, 0).apply(picture);
  const auto found = std::ranges::find(sent.pixels(), Rgba8{255, 255, 255, 255});
  const auto index = static_cast<int>(found - sent.pixels().begin());
  return {index % sent.width(), index / sent.width()};
}

TEST(WindowPlan, AWayOnThePanelIsTheOneItsPicturesPixelsGo) {
  Wall wall = load_wall("1x1@40x30");
  for (const int rotate : {0, 90, 180, 270}) {
    for (const Mirror mirror : {Mirror::None, Mirror::Horizontal, Mirror::Vertical}) {
      wall.screens[0].rotate = rotate;
      wall.screens[0].mirror = mirror;
      const glm::dvec2 motion = on_panel(wall, 13, 12) - on_panel(wall, 10, 7);
      const Pane pane = plan_windows(wall, {0})[0].panes[0];
      EXPECT_EQ(upright(pane, motion), glm::dvec2(3.0, 5.0))
          << rotate << " degrees, mirror " << static_cast<int>(mirror);
    }
  }
}

TEST(WindowPlan, AWindowWithoutASizeIsAsLargeAsItsScreens) {
  Wall wall = load_wall("1x1@40x30");
  wall.windows = {{.id = "w", .node = {}, .gpu = {}, .display = {}, .monitor = {}, .rect = {}}};
  wall.screens[0].window = "w";
  const auto plans = plan_windows(wall, {0});
  ASSERT_EQ(plans.size(), 1U);
  EXPECT_EQ(plans[0].rect, (Rect{0, 0, 40, 30}));
}

TEST(WindowPlan, AFullScreenWindowNamesItsMonitorAlsoOnceExpanded) {
  Wall wall = load_wall("1x1@40x30");
  wall.windows = {{.id = "w", .node = {}, .gpu = {}, .display = {}, .monitor = "DP-1", .rect = {}, .fullscreen = true}};
  wall.screens[0].window = "w";
  const auto plans = plan_windows(wall, {0});
  ASSERT_EQ(plans.size(), 1U);
  EXPECT_EQ(plans[0].monitor, "DP-1");
  EXPECT_TRUE(plans[0].fullscreen);
  EXPECT_FALSE(plans[0].decorated);
  EXPECT_NE(expand_wall(wall).find("monitor = \"DP-1\""), std::string::npos);
}

TEST(WindowPlan, OnlyTheScreensAskedForAreShown) {
  const Wall wall = load_wall("2x1@40x30");
  const auto plans = plan_windows(wall, {1});
  ASSERT_EQ(plans.size(), 1U);
  EXPECT_EQ(plans[0].panes[0].screen, 1U);
}

}  // namespace
}  // namespace hpr
