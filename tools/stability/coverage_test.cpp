#include <gtest/gtest.h>

#include "tools/stability/tools.h"

namespace hpr::stability {
namespace {

Mesh halves() {
  return rectangle({-2.0F, -2.0F}, {2.0F, 2.0F});
}

TEST(Coverage, CountsPixelsMissedAndPixelsOfTwoTriangles) {
  Drawer drawer({});
  const View view = head_on({64, 64}, 1.0, 0.01);
  const glm::dmat4 away = glm::dmat4(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -1, 1);
  const Coverage whole = coverage(drawer, halves(), away, view);
  EXPECT_EQ(whole.missed, 0U);
  EXPECT_EQ(whole.twice, 0U);
  Mesh half = halves();
  half.triangles.pop_back();
  EXPECT_NEAR(static_cast<double>(coverage(drawer, half, away, view).missed), 32.0 * 64.0, 32.0);
  Mesh doubled = halves();
  doubled.triangles.push_back(doubled.triangles.front());
  EXPECT_NEAR(static_cast<double>(coverage(drawer, doubled, away, view).twice), 32.0 * 64.0, 32.0);
}

}  // namespace
}  // namespace hpr::stability
