#include "tools/tradeoff/tradeoff.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "engine/settings_table.h"
#include "walls/codecs/codec.h"

namespace hpr {
namespace {

TradeoffPoint point(double ms, double flip, KnobValues knobs = {}) {
  TradeoffPoint made;
  made.knobs = std::move(knobs);
  made.ms = {ms};
  made.error.flip = flip;
  made.error.relmse = flip * flip;
  made.error.psnr = -20.0 * std::log10(flip);
  made.error.ssim = 1.0 - flip;
  return made;
}

TEST(KnobValues, AreSetOnTopOfOtherSettings) {
  RenderSettings base;
  set_setting(base, "quality", "best");
  const RenderSettings settings = with_knobs(base, {{"spp", "7"}, {"passes", "shadow+photon"}, {"reference", "true"}});
  EXPECT_EQ(settings.sampling.goal.samples, 7U);
  EXPECT_EQ(find_setting("passes")->value.write(settings), "shadow,photon");
  EXPECT_TRUE(settings.frame.rays.reference);
  EXPECT_EQ(settings.quality, Quality::Best);
  EXPECT_FALSE(with_knobs(settings, {{"reference", "false"}}).frame.rays.reference);
}

TEST(KnobValues, UnknownOnesAndBadValuesAreRefused) {
  for (const auto& [knob, value] : KnobValues{{"ssp", "1"}, {"max-depth", "0"}, {"max-depth", "many"}}) {
    EXPECT_THROW((void)with_knobs({}, {{knob, value}}), Error) << knob;
  }
}

TEST(KnobSweep, ListsAreSplit) {
  const KnobSweep sweep = parse_knob_sweep("spp=1,4,16");
  EXPECT_EQ(sweep.knob, "spp");
  EXPECT_EQ(sweep.values, (std::vector<std::string>{"1", "4", "16"}));
  for (const char* wrong : {"spp", "spp=", "spp=1,,2", "spp=1,", "spp=1,1", "=1", "ssp=1"}) {
    EXPECT_THROW((void)parse_knob_sweep(wrong), Error) << wrong;
  }
}

TEST(KnobSweep, CombinationsAreAllOfThemOnce) {
  const std::vector<KnobSweep> sweeps{{"spp", {"1", "2"}}, {"photons", {"0", "10", "20"}}};
  const auto all = combinations(sweeps);
  ASSERT_EQ(all.size(), 6U);
  EXPECT_EQ(all[1], (KnobValues{{"spp", "1"}, {"photons", "10"}}));
  EXPECT_EQ(all[5], (KnobValues{{"spp", "2"}, {"photons", "20"}}));
  const std::vector<KnobSweep> twice{{"spp", {"1"}}, {"spp", {"2"}}};
  EXPECT_THROW((void)combinations(twice), Error);
}

TEST(Pareto, OnlyWhatNothingBeatsIsMarked) {
  std::vector<TradeoffPoint> points{point(10, 0.5), point(20, 0.1), point(20, 0.2), point(30, 0.1), point(5, NAN)};
  for (const char* metric : {"flip", "relmse", "psnr", "ssim"}) {
    mark_pareto(points, metric);
    EXPECT_TRUE(points[0].pareto) << metric;
    EXPECT_TRUE(points[1].pareto) << metric;
    EXPECT_FALSE(points[2].pareto) << metric;
    EXPECT_FALSE(points[3].pareto) << metric;
  }
  mark_pareto(points, "flip");
  EXPECT_FALSE(points[4].pareto);
}

TEST(Pareto, EqualPointsStandTogether) {
  std::vector<TradeoffPoint> points{point(10, 0.5), point(10, 0.5)};
  mark_pareto(points, "flip");
  EXPECT_TRUE(points[0].pareto);
  EXPECT_TRUE(points[1].pareto);
}

TEST(Budget, TimeAsksForTheLeastError) {
  const std::vector<TradeoffPoint> points{point(10, 0.5), point(30, 0.2), point(40, 0.1)};
  EXPECT_EQ(best_within(points, parse_budget("33ms"), "flip"), 1U);
  EXPECT_EQ(best_within(points, parse_budget("1s"), "psnr"), 2U);
  EXPECT_EQ(best_within(points, parse_budget("9ms"), "flip"), std::nullopt);
}

TEST(Budget, OfErrorsAlikeTheFastestIsBest) {
  const std::vector<TradeoffPoint> points{point(20, 0.1), point(10, 0.1), point(15, 0.1)};
  EXPECT_EQ(best_within(points, parse_budget("1s"), "flip"), 1U);
  const std::vector<TradeoffPoint> alike{point(10, 0.2), point(10, 0.1)};
  EXPECT_EQ(best_within(alike, parse_budget("flip=0.3"), "flip"), 1U);
}

TEST(Budget, ErrorAsksForTheLeastTime) {
  const std::vector<TradeoffPoint> points{point(10, 0.5), point(30, 0.2), point(40, 0.1)};
  EXPECT_EQ(best_within(points, parse_budget("flip=0.3"), "flip"), 1U);
  EXPECT_EQ(best_within(points, parse_budget("psnr=19.9"), "flip"), 2U);
  EXPECT_EQ(best_within(points, parse_budget("ssim=0.4"), "flip"), 0U);
  EXPECT_EQ(best_within(points, parse_budget("flip=0.01"), "flip"), std::nullopt);
}

TEST(Budget, NonsenseIsRefused) {
  for (const char* wrong : {"", "33 apples", "-5ms", "flap=0.1", "flip=", "flip=-1", "flip=nan"}) {
    EXPECT_THROW((void)parse_budget(wrong), Error) << wrong;
  }
}

TEST(KnobSlope, AnErrorOfOneOverSamplesFallsWithSlopeMinusOne) {
  std::vector<TradeoffPoint> points;
  for (const char* photons : {"0", "100"}) {
    for (const char* spp : {"1", "4", "16"}) {
      points.push_back(point(1, std::sqrt(0.5 / std::stod(spp)), {{"spp", spp}, {"photons", photons}}));
    }
  }
  const std::vector<std::string> metrics{"relmse"};
  const auto slopes = knob_slopes(points, metrics);
  ASSERT_EQ(slopes.size(), 2U);  // two settings of photons; photons themselves are no more than one positive number
  for (const KnobSlope& slope : slopes) {
    EXPECT_EQ(slope.knob, "spp");
    EXPECT_NEAR(slope.slope, -1.0, 1e-12);
    EXPECT_NEAR(slope.spread, 0.0, 1e-6);
    EXPECT_EQ(slope.points, 3U);
  }
}

TEST(TradeoffPoint, TheMedianIsOfItsFrames) {
  TradeoffPoint made = point(3, 0);
  made.ms = {9, 1, 4};
  EXPECT_DOUBLE_EQ(made.median_ms(), 4.0);
  made.ms = {9, 1, 4, 2};
  EXPECT_DOUBLE_EQ(made.median_ms(), 3.0);
}

}  // namespace
}  // namespace hpr
