#include <gtest/gtest.h>

#include "walls/config/wall_file.h"
#include "walls/drawing/assemble.h"

namespace hpr {
namespace {

Image<Rgba8> filled(Size size, std::uint8_t value) {
  return Image<Rgba8>(size, {value, value, value, 255});
}

TEST(Monitors, ShowASurfaceInTheMiddleWithItsGaps) {
  Wall wall = load_wall("3x1@100x100");
  wall.gap_color = {1, 2, 3, 255};
  const WallMonitor monitor{"operator", "wall", {320, 200}};
  const MonitorLayout layout = monitor_layout(wall, monitor);
  ASSERT_EQ(layout.rects.size(), 3U);
  EXPECT_EQ(layout.surface.x0, 0);
  EXPECT_EQ(layout.surface.x1, 320);
  EXPECT_NEAR(layout.surface.y0, 200 - layout.surface.y1, 1);
  EXPECT_NEAR(layout.rects[0].width(), layout.rects[0].height(), 1);
  EXPECT_GT(layout.rects[1].x0, layout.rects[0].x1);
  const std::vector<Image<Rgba8>> pictures{filled({100, 100}, 50), filled({100, 100}, 100), Image<Rgba8>()};
  const Image<Rgba8> drawn = draw_monitor(wall, monitor, layout, pictures);
  ASSERT_EQ(drawn.size(), monitor.pixels);
  EXPECT_EQ(drawn.at(0, 0), (Rgba8{0, 0, 0, 255}));
  EXPECT_EQ(drawn.at(50, 100).r, 50);
  EXPECT_EQ(drawn.at(160, 100).r, 100);
  EXPECT_EQ(drawn.at(layout.rects[0].x1, 100), wall.gap_color);
  EXPECT_EQ(drawn.at(300, 100), wall.gap_color);  // nothing came from there
}

TEST(Monitors, ShowOnlyTheirSurfaceAndTheLeftEyeOfTwo) {
  Wall wall = load_wall("2x1@10x10");
  wall.screens[0].surface = "front";
  wall.screens[1] = wall.screens[0];
  wall.screens[0].eye = Eye::Right;
  wall.screens[1].eye = Eye::Left;
  const WallMonitor monitor{"operator", "front", {7, 5}};
  EXPECT_EQ(monitor_layout(wall, monitor).screens, std::vector<std::size_t>{1});
  wall.screens[1].surface = "floor";
  EXPECT_EQ(monitor_layout(wall, monitor).screens, std::vector<std::size_t>{0});
}

TEST(Monitors, OfAnySizeHoldAllScreens) {
  const Wall wall = load_wall("9x7@64x36");
  for (const Size size : {Size{1, 1}, Size{2, 900}, Size{900, 2}, Size{13, 17}, Size{4000, 4000}}) {
    const WallMonitor monitor{"operator", "wall", size};
    const MonitorLayout layout = monitor_layout(wall, monitor);
    for (const Rect& rect : layout.rects) {
      EXPECT_FALSE(rect.empty());
      EXPECT_EQ(intersection(rect, {0, 0, size.width, size.height}), rect);
    }
    const std::vector<Image<Rgba8>> pictures(wall.screens.size(), filled({64, 36}, 90));
    EXPECT_EQ(draw_monitor(wall, monitor, layout, pictures).size(), size);
  }
}

}  // namespace
}  // namespace hpr
