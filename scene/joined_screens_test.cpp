#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <initializer_list>

#include "scene/view.h"

namespace hpr {
namespace {

constexpr double kPitch = 0.01;

/// A screen of the plane a metre before the eye, in pixels from its upper left corner.
View screen(double x, double y, Size pixels, double pitch = kPitch) {
  View view;
  view.eye = {3.0, 2.0, 1.0};
  view.left = -1.0 + kPitch * x;
  view.right = view.left + pitch * pixels.width;
  view.top = 0.7 - kPitch * y;
  view.bottom = view.top - pitch * pixels.height;
  view.screen = pixels;
  view.block = {0, 0, pixels.width, pixels.height};
  return view;
}

std::vector<View> numbered(std::initializer_list<View> screens) {
  std::vector<View> views(screens);
  for (std::size_t i = 0; i < views.size(); ++i) views[i].screen_number = static_cast<std::uint32_t>(i);
  return views;
}

void expect_unjoined(const std::vector<View>& views) {
  const std::vector<View> joined = join_screens(views);
  ASSERT_EQ(joined.size(), views.size());
  for (std::size_t i = 0; i < views.size(); ++i) {
    EXPECT_EQ(joined[i].screen, views[i].screen) << i;
    EXPECT_EQ(joined[i].block, views[i].block) << i;
    EXPECT_EQ(joined[i].left, views[i].left) << i;
    EXPECT_EQ(joined[i].screen_number, views[i].screen_number) << i;
  }
}

TEST(JoinScreens, BecomeBlocksOfTheScreenTheySpan) {
  const View whole = screen(0, 0, {70, 50});
  // Of several sizes, some meeting others in the middle of an edge, in any order.
  const std::vector<View> views =
      numbered({screen(30, 0, {40, 20}), screen(0, 20, {25, 30}), screen(0, 0, {30, 20}), screen(25, 20, {45, 30})});
  const std::vector<View> joined = join_screens(views);
  const std::vector<Rect> blocks{{30, 0, 70, 20}, {0, 20, 25, 50}, {0, 0, 30, 20}, {25, 20, 70, 50}};
  for (std::size_t i = 0; i < views.size(); ++i) {
    EXPECT_EQ(joined[i].screen, whole.screen);
    EXPECT_EQ(joined[i].block, blocks[i]);
    EXPECT_EQ(joined[i].screen_number, 0U);
    EXPECT_EQ(joined[i].left, whole.left);
    EXPECT_EQ(joined[i].top, whole.top);
    EXPECT_DOUBLE_EQ(joined[i].right, whole.right);
    EXPECT_DOUBLE_EQ(joined[i].bottom, whole.bottom);
    const Ray ray = view_ray(joined[i], 3.5, 4.5);
    EXPECT_LT(glm::distance(ray.direction, view_ray(views[i], 3.5, 4.5).direction), 1e-12);
  }
}

TEST(JoinScreens, GroupsAreApart) {
  const std::vector<View> views = numbered({screen(0, 0, {20, 20}), screen(100, 0, {20, 20}), screen(20, 0, {20, 20}),
                                            screen(120, 0, {20, 20}), screen(200, 0, {20, 20})});
  const std::vector<View> joined = join_screens(views);
  EXPECT_EQ(joined[0].screen, (Size{40, 20}));
  EXPECT_EQ(joined[3].screen, (Size{40, 20}));
  EXPECT_EQ(joined[3].block, (Rect{20, 0, 40, 20}));
  EXPECT_EQ(joined[3].screen_number, 1U);
  EXPECT_EQ(joined[4].screen, (Size{20, 20}));
}

TEST(JoinScreens, AnLKeepsItsPlaces) {
  const std::vector<View> joined =
      join_screens(numbered({screen(0, 0, {20, 20}), screen(0, 20, {20, 20}), screen(20, 20, {20, 20})}));
  EXPECT_EQ(joined[2].screen, (Size{40, 40}));
  EXPECT_EQ(joined[2].block, (Rect{20, 20, 40, 40}));
}

TEST(JoinScreens, OthersStayAsTheyAre) {
  const View first = screen(0, 0, {20, 20});
  expect_unjoined(numbered({first}));
  expect_unjoined(numbered({first, screen(21, 0, {20, 20})}));                  // a gap of a pixel
  expect_unjoined(numbered({first, screen(20.1, 0, {20, 20})}));                // and of a tenth of one
  expect_unjoined(numbered({first, screen(20, 0.5, {20, 20})}));                // moved along the edge
  expect_unjoined(numbered({first, screen(20, 20, {20, 20})}));                 // they meet in a corner only
  expect_unjoined(numbered({first, screen(20, 0, {40, 40}, 0.5 * kPitch)}));    // finer pixels
  expect_unjoined(numbered({first, screen(20, 0, {20, 20}, 1.006 * kPitch)}));  // a bit coarser ones
  View other = screen(20, 0, {20, 20});
  other.eye.x += 0.06;
  expect_unjoined(numbered({first, other}));
  other = screen(20, 0, {20, 20});
  other.axes = {{0.0, 1.0, 0.0}, {-1.0, 0.0, 0.0}, {0.0, 0.0, 1.0}};
  expect_unjoined(numbered({first, other}));
  other = screen(20, 0, {20, 20});
  other.orthographic = true;
  expect_unjoined(numbered({first, other}));
  other = screen(20, 0, {20, 20});
  other.points.emplace();
  expect_unjoined(numbered({first, other}));
}

TEST(JoinScreens, AFractionOfAPixelDoesNotMatter) {
  const std::vector<View> joined =
      join_screens(numbered({screen(0, 0, {20, 20}), screen(20.05, -0.05, {20, 20}), screen(-20.01, 0, {20, 20})}));
  EXPECT_EQ(joined[1].screen, (Size{60, 20}));
  EXPECT_EQ(joined[1].block, (Rect{40, 0, 60, 20}));
}

}  // namespace
}  // namespace hpr
