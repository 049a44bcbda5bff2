#include "tools/stability/tools.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace hpr::stability {
namespace {

TEST(AddPoint, ExtendsTheCurveAndCountsForTheWorstNumberWhereItIsPromised) {
  StabilityFinding finding = make_finding("case/number", "gap", 1.0, "relative", "because");
  add_point(finding, 1.0, 0.5);
  add_point(finding, 2.0, 0.25);
  add_point(finding, 3.0, 0.75, false);
  EXPECT_EQ(finding.measured, 0.5);
  EXPECT_EQ(finding.curve.points, (std::vector<std::pair<double, double>>{{1.0, 0.5}, {2.0, 0.25}, {3.0, 0.75}}));
  add_point(finding, 4.0, std::nan(""));
  EXPECT_EQ(finding.measured, std::numeric_limits<double>::infinity());
}

TEST(Shares, AreOfSurfacesNotOfDepths) {
  Image<Key> a({4, 1});
  for (int x = 0; x < 4; ++x) a.at(x, 0) = make_key(0.5F, x < 2 ? 7 : 8);
  Image<Key> b = a;
  b.at(0, 0) = make_key(0.25F, 7);
  EXPECT_EQ(other_surfaces(a, b), 0.0);
  b.at(1, 0) = kNoKey;
  EXPECT_EQ(other_surfaces(a, b), 0.25);
  EXPECT_EQ(edges(a), 0.5);
}

TEST(Shares, OfColorsCountFromTwoLevelsOn) {
  const auto gray = [](float value) { return Rgb{value, value, value}; };
  Image<Rgb> a({2, 1});
  a.at(0, 0) = a.at(1, 0) = gray(srgb_to_linear(100));
  Image<Rgb> b = a;
  b.at(0, 0) = gray(srgb_to_linear(101));
  b.at(1, 0).g = srgb_to_linear(102);
  EXPECT_EQ(other_colors(a, b), 0.5);
  EXPECT_EQ(color_edges(a), 0.0);
  EXPECT_EQ(color_edges(b), 0.0);
}

}  // namespace
}  // namespace hpr::stability
