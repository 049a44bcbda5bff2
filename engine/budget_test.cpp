#include "engine/budget.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "engine/frame_settings.h"
#include "rt/passes/pass_id.h"

namespace hpr {
namespace {

double pixels(const Effort& effort) {
  return effort.samples * std::pow(scale_of_step(effort.scale_step), 2);
}

struct Trace {
  std::vector<double> ms;
  std::vector<Effort> efforts;

  [[nodiscard]] double percentile(double p, std::size_t from = 0) const {
    std::vector<double> sorted(ms.begin() + static_cast<std::ptrdiff_t>(from), ms.end());
    std::ranges::sort(sorted);
    return sorted[static_cast<std::size_t>(p * static_cast<double>(sorted.size() - 1))];
  }
  [[nodiscard]] int changes(std::size_t from) const {
    int count = 0;
    for (std::size_t i = from + 1; i < efforts.size(); ++i) count += efforts[i] == efforts[i - 1] ? 0 : 1;
    return count;
  }
};

/// `cost` says what a frame takes; times scatter by `noise`, relative.
Trace simulate(const BudgetSettings& settings, int frames, double noise,
               const std::function<double(int frame, const Effort&)>& cost) {
  FrameBudget budget(settings);
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  Trace run;
  for (int frame = 0; frame < frames; ++frame) {
    run.efforts.push_back(budget.effort());
    run.ms.push_back(cost(frame, budget.effort()) * std::exp(noise * normal(random)));
    budget.record_frame_time(run.ms.back());
  }
  return run;
}

TEST(FrameBudget, ScalesFallFromAllPixelsToATenthASide) {
  EXPECT_EQ(scale_of_step(0), 1.0);
  EXPECT_DOUBLE_EQ(scale_of_step(kScaleSteps - 1), 0.1);
  for (int step = 1; step < kScaleSteps; ++step) {
    const double ratio = std::pow(scale_of_step(step) / scale_of_step(step - 1), 2);
    EXPECT_NEAR(ratio, 8.0 / 9.0, 0.01);
  }
}

TEST(FrameBudget, HoldsTheTargetWhateverAPixelCosts) {
  for (const double each : {40.0, 150.0, 900.0, 3000.0}) {
    for (const double fixed : {0.5, 8.0, 15.0}) {
      for (const double noise : {0.0, 0.03, 0.08}) {
        const Trace run = simulate({.target_ms = 33.0}, 300, noise,
                                   [&](int, const Effort& effort) { return fixed + each * pixels(effort); });
        const double least = fixed + each * 0.01;
        if (least > 25.0) continue;
        EXPECT_LE(run.percentile(0.95), 1.15 * 33.0) << each << " ms, fixed " << fixed << ", noise " << noise;
        EXPECT_GE(run.percentile(0.5), std::min(0.7 * 33.0, 0.95 * (fixed + each)))
            << each << ' ' << fixed << ' ' << noise;
        EXPECT_LE(run.changes(100), noise > 0.05 ? 60 : 12) << each << ' ' << fixed << ' ' << noise;
      }
    }
  }
}

TEST(FrameBudget, WithoutNoiseItComesToRest) {
  const Trace run = simulate({.target_ms = 100.0, .degradations = 3}, 200, 0.0,
                             [](int, const Effort& effort) { return 5.0 + 700.0 * pixels(effort); });
  EXPECT_EQ(run.changes(40), 0);
}

TEST(FrameBudget, FollowsAPathOnWhichPixelsCostMoreAndLess) {
  const Trace run = simulate({.target_ms = 100.0, .degradations = 3}, 300, 0.04, [](int frame, const Effort& effort) {
    const double each = 1500.0 * (1.0 + 0.6 * std::sin(2.0 * std::numbers::pi * frame / 100.0));
    return 6.0 + each * std::pow(0.8, effort.degradations) * pixels(effort);
  });
  EXPECT_LE(run.percentile(0.95), 115.0);
  EXPECT_GE(run.percentile(0.5), 70.0);
}

TEST(FrameBudget, AStepUpIsCaughtInAFewFramesAndOneDownIsUsed) {
  const Trace run = simulate({.target_ms = 50.0}, 300, 0.03, [](int frame, const Effort& effort) {
    return 3.0 + (frame / 100 == 1 ? 2000.0 : 500.0) * pixels(effort);
  });
  const auto over = [&](int from, int to) {
    return std::count_if(run.ms.begin() + from, run.ms.begin() + to, [](double ms) { return ms > 57.5; });
  };
  EXPECT_LE(over(100, 200), 5);
  EXPECT_LE(over(104, 200), 3);
  const Trace late{{run.ms.begin() + 220, run.ms.end()}, {}};
  EXPECT_GE(late.percentile(0.5), 35.0);
}

TEST(FrameBudget, OneSlowFrameAloneChangesNothing) {
  Trace run = simulate({.target_ms = 50.0}, 120, 0.0, [](int frame, const Effort& effort) {
    return (3.0 + 500.0 * pixels(effort)) * (frame == 100 ? 6.0 : 1.0);
  });
  EXPECT_EQ(run.changes(90), 0);
}

TEST(FrameBudget, KeepsThePixelsOfASceneThatDoesNotScale) {
  const Trace run =
      simulate({.target_ms = 33.0}, 400, 0.02, [](int, const Effort& effort) { return 80.0 + 2.0 * pixels(effort); });
  EXPECT_EQ(run.efforts.back().scale_step, 0);
}

TEST(FrameBudget, GoesAsFarAsItCanWhereTheTargetIsOutOfReach) {
  const Trace run =
      simulate({.target_ms = 33.0}, 200, 0.02, [](int, const Effort& effort) { return 30.0 + 5e4 * pixels(effort); });
  EXPECT_GE(run.efforts.back().scale_step, kScaleSteps - 4);
}

TEST(FrameBudget, GivesUpSamplesThenDegradationsThenPixels) {
  const auto settled = [](double each) {
    return simulate({.target_ms = 100.0, .max_samples = 16, .degradations = 2}, 200, 0.0,
                    [&](int, const Effort& effort) {
                      return 2.0 + each * std::pow(0.6, effort.degradations) * pixels(effort);
                    })
        .efforts.back();
  };
  EXPECT_EQ(settled(4.0), (Effort{16, 0, 0}));
  EXPECT_EQ(settled(20.0), (Effort{4, 0, 0}));
  EXPECT_EQ(settled(80.0), (Effort{1, 0, 0}));
  EXPECT_EQ(settled(120.0), (Effort{1, 1, 0}));
  EXPECT_EQ(settled(200.0), (Effort{1, 2, 0}));
  const Effort least = settled(1000.0);
  EXPECT_EQ(least.degradations, 2);
  EXPECT_GT(least.scale_step, 0);
}

TEST(FrameBudget, AnEconomyThatSavesNothingIsNoReasonToSwing) {
  const Trace run = simulate({.target_ms = 100.0, .degradations = 2}, 300, 0.02,
                             [](int, const Effort& effort) { return 2.0 + 110.0 * pixels(effort); });
  EXPECT_LE(run.changes(100), 4);
  EXPECT_LE(run.percentile(0.95, 50), 115.0);
}

TEST(FrameBudget, IgnoresTimesThatAreNone) {
  FrameBudget budget({.target_ms = 33.0});
  const Effort first = budget.effort();
  for (const double ms : {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()})
    budget.record_frame_time(ms);
  EXPECT_EQ(budget.effort(), first);
}

using Names = std::vector<std::string>;

const std::vector<PassPlan> kAllRun{
    {PassId::Shadow, true, ""}, {PassId::Reflection, true, ""}, {PassId::Photon, true, ""}};

TEST(Degradations, AreThoseThatSaveSomething) {
  EXPECT_EQ(degradations_for({}, kAllRun), (Names{"half-resolution", "photons", "glossy-cutoff"}));
  EXPECT_EQ(degradations_for({}, {}), (Names{"half-resolution"}));
  EXPECT_EQ(degradations_for({}, kAllRun, true), (Names{"photons", "glossy-cutoff"})) << "the light leaves its device";
  FrameSettings local;
  local.shading = Shading::Local;
  EXPECT_EQ(degradations_for(local, {}), Names{});
  FrameSettings reference;
  reference.rays.reference = true;
  EXPECT_EQ(degradations_for(reference, kAllRun), Names{});
  FrameSettings draft;
  draft.rays.glossy_cutoff = 0.1;
  draft.rays.max_depth = 2;
  EXPECT_EQ(degradations_for(draft, kAllRun), (Names{"half-resolution", "photons"}));
}

TEST(Degradations, WithoutPhotonsNoOtherPassStarts) {
  FrameSettings settings;
  settings.rays.passes = {PassId::Photon};
  settings.rays.photons = 5;
  settings.rays.global_photons = true;
  const FrameSettings less = apply_degradations(settings, Names{"photons"});
  EXPECT_TRUE(less.rays.passes.empty());
  EXPECT_FALSE(less.rays.auto_passes);
  EXPECT_FALSE(less.rays.global_photons);
  EXPECT_TRUE(apply_degradations({}, Names{"photons"}).rays.auto_passes);
}

TEST(Degradations, NeverMakeAFrameDearer) {
  FrameSettings settings;
  settings.rays.glossy_cutoff = 0.05;
  settings.rays.max_depth = 1;
  const FrameSettings less = apply_degradations(settings, Names{"half-resolution", "glossy-cutoff"});
  EXPECT_EQ(less.rays.glossy_cutoff, 0.05);
  EXPECT_EQ(less.rays.max_depth, 1);
  EXPECT_EQ(less.rays.half_resolution.size(), 5U);
  EXPECT_EQ(apply_degradations(settings, {}).rays, settings.rays);
}

}  // namespace

}  // namespace hpr
