#include "tools/stability/stability.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <optional>
#include <set>

#include "core/json.h"

namespace hpr {
namespace {

StabilityFinding finding_of(double limit, double measured, Bound bound = Bound::AtMost) {
  StabilityFinding finding;
  finding.name = "case/number";
  finding.parameter = "gap 1e-2 .. 1e-7";
  finding.limit = limit;
  finding.measured = measured;
  finding.unit = "relative";
  finding.bound = bound;
  finding.why = "because";
  return finding;
}

TEST(BreakingPoint, IsTheEndThatDoesNotHoldWithinTheToleranceFromEitherSide) {
  const auto below = [](double x) { return x < 3e4; };
  const double up = breaking_point(1.0, 1e9, 0.01, below);
  EXPECT_GE(up, 3e4);
  EXPECT_LT(up, 3e4 * 1.01);
  const auto above = [](double x) { return x > 2e-5; };
  const double down = breaking_point(1.0, 1e-12, 0.01, above);
  EXPECT_LE(down, 2e-5);
  EXPECT_GT(down, 2e-5 / 1.01);
  const double negative = breaking_point(-1.0, -1e9, 0.01, [](double x) { return x > -3e4; });
  EXPECT_LE(negative, -3e4);
  EXPECT_GT(negative, -3e4 * 1.01);
}

TEST(BreakingPoint, AsksAboutAsOftenAsItSays) {
  int asked = 0;
  (void)breaking_point(1.0, 1e6, 1e-3, [&](double x) {
    ++asked;
    return x < 10.0;
  });
  EXPECT_LE(asked, 1 + std::ceil(std::log2(std::log(1e6) / 1e-3)));
}

TEST(BreakingPoint, IsTheFirstWhereSeveralRangesBreak) {
  const auto holds_twice = [](double x) { return x < 200.0 || (x > 5e4 && x < 1e8); };
  const std::optional<double> found = breaking_point_if_any(1.0, 1e9, 0.01, holds_twice);
  ASSERT_TRUE(found);
  EXPECT_NEAR(*found, 200.0, 2.0);
  const auto holds_outside = [](double x) { return x < 200.0 || x > 5e4; };
  EXPECT_NEAR(breaking_point_if_any(1.0, 1e9, 0.01, holds_outside).value_or(0.0), 200.0, 2.0);
  const auto above = [](double x) { return x > 2e-5; };
  EXPECT_NEAR(breaking_point_if_any(1.0, 3e-8, 0.01, above).value_or(0.0), 2e-5, 2e-7);
  EXPECT_FALSE(breaking_point_if_any(1.0, 1e9, 0.01, [](double) { return true; }));
  EXPECT_FALSE(breaking_point_if_any(1.0, 1e9, 0.01, [](double) { return false; }));
  EXPECT_NEAR(breaking_point_if_any(1.0, 3e8, 0.01, [](double x) { return x < 2.9e8; }).value_or(0.0), 2.9e8, 3e6);
}

TEST(BreakingPoint, OfACurveIsBesideAPointThatHolds) {
  StabilityFinding finding = finding_of(0.5, 6.0);
  EXPECT_FALSE(breaking_point_of_curve(finding));
  finding.curve.points = {{1e-6, 0.0}, {1.0, 0.25}};
  EXPECT_FALSE(breaking_point_of_curve(finding));
  finding.curve.points = {{1e-6, 6.0}, {1e-3, 1.0}, {1.0, 0.25}};
  EXPECT_EQ(breaking_point_of_curve(finding), 1e-3);
  finding.curve.points = {{1e-6, 0.0}, {1e-3, std::nan("")}, {1.0, 7.0}};
  EXPECT_EQ(breaking_point_of_curve(finding), 1e-3);
  finding.curve.points = {{1e-6, 6.0}, {1e-3, 1.0}};
  EXPECT_EQ(breaking_point_of_curve(finding), 1e-6);
  finding.bound = Bound::AtLeast;
  EXPECT_FALSE(breaking_point_of_curve(finding));
}

TEST(StabilityFinding, HoldsOnItsSideOfTheLimitAndAtIt) {
  EXPECT_TRUE(finding_of(1.0, 1.0).holds());
  EXPECT_FALSE(finding_of(1.0, 1.5).holds());
  EXPECT_FALSE(finding_of(1.0, std::numeric_limits<double>::infinity()).holds());
  EXPECT_FALSE(finding_of(1.0, std::nan("")).holds());
  EXPECT_TRUE(finding_of(1.0, 1.5, Bound::AtLeast).holds());
  EXPECT_FALSE(finding_of(1.0, 0.5, Bound::AtLeast).holds());
  EXPECT_FALSE(finding_of(1.0, std::nan(""), Bound::AtLeast).holds());
}

TEST(StabilityJson, HasWhatTheSchemaSays) {
  std::vector<StabilityFinding> findings{finding_of(0.5, 0.25),
                                         finding_of(0.5, std::numeric_limits<double>::infinity())};
  findings[0].breaks_at = 3e8;
  const auto json = Json::parse(stability_json(findings));
  EXPECT_EQ(json.at("schema"), "hpr.stability/1");
  ASSERT_EQ(json.at("cases").size(), 2U);
  const auto& first = json.at("cases")[0];
  EXPECT_EQ(first.at("name"), "case/number");
  EXPECT_EQ(first.at("parameter"), "gap 1e-2 .. 1e-7");
  EXPECT_EQ(first.at("limit"), 0.5);
  EXPECT_EQ(first.at("measured"), 0.25);
  EXPECT_EQ(first.at("unit"), "relative");
  EXPECT_EQ(first.at("verdict"), "holds");
  EXPECT_EQ(first.at("breaks_at"), 3e8);
  const auto& second = json.at("cases")[1];
  EXPECT_TRUE(second.at("measured").is_number()) << "infinity is no JSON";
  EXPECT_EQ(second.at("verdict"), "breaks");
  EXPECT_TRUE(second.at("breaks_at").is_null());
}

TEST(StabilityTable, NamesWhatBreaks) {
  const std::vector<StabilityFinding> findings{finding_of(0.5, 0.25), finding_of(0.5, 0.75)};
  const std::string table = stability_table(findings);
  EXPECT_NE(table.find("BREAKS"), std::string::npos);
  EXPECT_NE(table.find("1 of 2 hold"), std::string::npos);
  EXPECT_NE(table.find("none found"), std::string::npos);
}

TEST(StabilityHtml, IsMarkupOfItsOwnOnlyAndDrawsZerosAndInfinitiesToo) {
  std::vector<StabilityFinding> findings{finding_of(0.0, 0.0), finding_of(0.5, 0.75)};
  findings[0].name = findings[0].unit = findings[0].why = findings[0].curve.x = "<script>&\"";
  findings[0].curve.points = {{1e-3, 0.0}, {1.0, 0.0}};
  findings[1].curve = {"gap", {{1e-6, HUGE_VAL}, {1e-3, 0.0}, {1.0, 1e-3}}, {{1e-6, 0.1}, {1.0, 0.1}}};
  findings[1].breaks_at = 1e-7;
  const std::string page = stability_html(findings);
  EXPECT_EQ(page.find("<script"), std::string::npos);
  EXPECT_NE(page.find("1 of 2 hold"), std::string::npos);
  EXPECT_NE(page.find("breaks at 1e-07"), std::string::npos);
  for (const char* bad : {"nan", "=\"inf", "=\"-", ",-", "-inf"}) EXPECT_EQ(page.find(bad), std::string::npos) << bad;
}

TEST(StabilityCases, HaveNamesOfTheirOwnAndSayWhatTheyAreAbout) {
  std::set<std::string_view> names;
  for (const StabilityCase& one : all_stability_cases()) {
    EXPECT_TRUE(names.insert(one.name).second) << one.name;
    EXPECT_FALSE(one.about.empty());
    EXPECT_TRUE(one.measure);
  }
}

}  // namespace
}  // namespace hpr
