#include "tools/compare/distributions/distribution_run.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "cluster/distribution/assignment.h"
#include "cluster/transport/local_communicator.h"
#include "core/error.h"
#include "core/file.h"
#include "tools/compare/distributions/distribution_comparison.h"
#include "tools/compare/distributions/measure_distribution.h"

namespace hpr {
namespace {

RankFrame frame_of(double draw, double composite, double light, double exchange, double collect) {
  return {.ms = draw + composite + light + exchange + 1.0,
          .stages = {.draw_ms = draw,
                     .composite_ms = composite,
                     .light_ms = light,
                     .return_ms = exchange - collect,
                     .collect_ms = collect},
          .work_ms = draw,
          .bytes = static_cast<std::uint64_t>(10.0 * draw),
          .messages = 1};
}

TEST(StagesOf, OneRankHasItsOwn) {
  const RankFrame alone = frame_of(1, 2, 3, 5, 4);
  const FrameStages stages = stages_of(std::span(&alone, 1), Shading::Deferred);
  EXPECT_EQ(stages.draw_ms, 1.0);
  EXPECT_EQ(stages.composite_ms, 2.0);
  EXPECT_EQ(stages.light_ms, 3.0);
  EXPECT_EQ(stages.exchange_ms, 5.0);
  EXPECT_EQ(stages.collect_ms, 4.0);
}

TEST(StagesOf, WaitingCountsAsWhatWasWaitedFor) {
  // The first rank waits for the keys of the second while it composites, and the second for the light of the first.
  const std::vector<RankFrame> ranks{frame_of(10, 21, 50, 2, 1), frame_of(30, 1, 5, 47, 1)};
  const FrameStages stages = stages_of(ranks, Shading::Deferred);
  EXPECT_EQ(stages.draw_ms, 30.0);
  EXPECT_EQ(stages.composite_ms, 1.0);
  EXPECT_EQ(stages.light_ms, 50.0);
  EXPECT_EQ(stages.exchange_ms, 2.0);
  EXPECT_EQ(stages.collect_ms, 1.0);
}

TEST(StagesOf, WhatIsWaitedForBeforeLightIsNoLight) {
  // The first rank waits for the keys of the second, which lights little.
  std::vector<RankFrame> ranks{frame_of(10, 0, 50, 0, 0), frame_of(100, 0, 10, 0, 0)};
  ranks[0].stages.move_ms = 90.0;
  const FrameStages stages = stages_of(ranks, Shading::Deferred);
  EXPECT_EQ(stages.draw_ms, 100.0);
  EXPECT_EQ(stages.exchange_ms, 0.0);
  EXPECT_EQ(stages.light_ms, 50.0);
}

TEST(StagesOf, LayersThatAreLitBeforeTheyAreCompositedAreWaitedForAsLight) {
  const std::vector<RankFrame> ranks{frame_of(1, 80, 10, 1, 1), frame_of(1, 2, 88, 1, 1)};
  const FrameStages stages = stages_of(ranks, Shading::Local);
  EXPECT_EQ(stages.draw_ms, 1.0);
  EXPECT_EQ(stages.light_ms, 88.0);
  EXPECT_EQ(stages.composite_ms, 2.0);
  EXPECT_EQ(stages_of(ranks, Shading::Deferred).composite_ms, 80.0);
}

TEST(DistributionRun, AddsRanksUpFrameByFrame) {
  DistributionRun run;
  run.add(std::vector{frame_of(10, 0, 0, 0, 0), frame_of(30, 0, 0, 0, 0)});
  EXPECT_EQ(run.ms, std::vector{31.0});
  EXPECT_EQ(run.imbalance, std::vector{1.5});
  EXPECT_EQ(run.bytes_total, std::vector<std::uint64_t>{400});
  EXPECT_EQ(run.bytes_max_rank, std::vector<std::uint64_t>{300});
  EXPECT_EQ(run.messages_total, std::vector<std::uint64_t>{2});
}

TEST(DistributionRun, OfSeveralJobsHasAllFramesAndTheWorst) {
  DistributionRun run;
  run.add(std::vector{frame_of(10, 0, 0, 0, 0)});
  run.memory_peak_bytes = {100, 300};
  run.differing_pixels = 2;
  DistributionRun more = run;
  more.add(std::vector{frame_of(20, 0, 0, 0, 0)});
  more.memory_peak_bytes = {200, 250};
  more.differing_pixels = 1;
  more.predicted_ms = 5.0;
  run.append(more);
  EXPECT_EQ(run.ms, (std::vector{11.0, 11.0, 21.0}));
  EXPECT_EQ(run.light_ms.size(), 3U);
  EXPECT_EQ(run.bytes_max_rank.size(), 3U);
  EXPECT_EQ(run.memory_peak_bytes, (std::vector<std::uint64_t>{200, 300}));
  EXPECT_EQ(run.differing_pixels, 2U);
  EXPECT_EQ(run.predicted_ms, 5.0);
}

TEST(DistributionRun, IsHandedOverWhole) {
  DistributionRun run;
  run.distribution = "auto";
  run.chosen = "hybrid";
  run.strategy = "radix-k:2,2";
  run.ranks = 4;
  run.add(std::vector{frame_of(1, 2, 3, 4, 0.5), frame_of(2, 2, 3, 4, 0.5)});
  run.memory_peak_bytes = {1ULL << 40U, 3};
  run.differing_pixels = 7;
  const Json json = Table(distribution_job_columns(), std::span<const DistributionRun>(&run, 1)).json();
  const DistributionRun again = rows_from_json(distribution_job_columns(), Json::parse(json.dump())).at(0);
  EXPECT_EQ(again.chosen, "hybrid");
  EXPECT_EQ(again.strategy, "radix-k:2,2");
  EXPECT_EQ(again.draw_ms, run.draw_ms);
  EXPECT_EQ(again.exchange_ms, run.exchange_ms);
  EXPECT_EQ(again.memory_peak_bytes, run.memory_peak_bytes);
  EXPECT_EQ(again.differing_pixels, 7U);
  EXPECT_FALSE(again.predicted_ms);
}

WholeFrame small_frame() {
  WholeFrame frame{Image<Key>({3, 2}, 5), Image<Rgba8>({3, 2}, Rgba8{1, 2, 3, 255})};
  frame.keys.pixels()[4] = ~Key{0};
  return frame;
}

TEST(CountDiffering, CountsAPixelOnceWhoseKeyOrColorDiffers) {
  const WholeFrame frame = small_frame();
  WholeFrame other = frame;
  EXPECT_EQ(count_differing(frame, other), 0U);
  other.keys.pixels()[0] = 6;
  EXPECT_EQ(count_differing(frame, other), 1U);
  other.picture.pixels()[5].r = 0;
  EXPECT_EQ(count_differing(frame, other), 2U) << "a key here, a color there";
  other.picture.pixels()[0].a = 254;
  EXPECT_EQ(count_differing(frame, other), 2U);
  other.picture = Image<Rgba8>({2, 3});
  EXPECT_EQ(count_differing(frame, other), 6U) << "another size";
}

TEST(CountDiffering, FewerKeysThanPixelsCountByThemselves) {
  WholeFrame frame = small_frame();
  frame.keys = Image<Key>({2, 1}, 5);
  WholeFrame other = frame;
  other.keys.pixels()[1] = 6;
  EXPECT_EQ(count_differing(frame, other), 1U);
  other.picture.pixels()[3].g = 9;
  other.picture.pixels()[4].g = 9;
  EXPECT_EQ(count_differing(frame, other), 2U);
}

TEST(WriteFrame, IsReadToTheBit) {
  const TemporaryFile file;
  write_frame(file.path(), {Image<Key>({90, 70}, 1), Image<Rgba8>({90, 70})});
  write_frame(file.path(), small_frame());  // nothing of the longer one is left
  EXPECT_EQ(count_differing(read_frame(file.path()), small_frame()), 0U);
}

TEST(DistributionJob, IsAskedForInTheEnvironment) {
  const DistributionJob job{"sort-last", 3, {2, 5}, true, false, true, "/tmp/a \"file\""};
  ::setenv(DistributionJob::kVariable, job.text().c_str(), 1);
  const auto asked = DistributionJob::of_this_process();
  ::unsetenv(DistributionJob::kVariable);
  ASSERT_TRUE(asked);
  EXPECT_EQ(asked->text(), job.text());
  EXPECT_EQ(asked->reference, "/tmp/a \"file\"");
  EXPECT_EQ(asked->frames.measured, 5);
  EXPECT_FALSE(DistributionJob::of_this_process());
}

DistributionInput small_input() {
  DistributionInput input{.scene = "gen:cornell", .settings = {}, .screen = {100, 70}, .grid = {2, 1}, .seed = 1};
  set_setting(input.settings, "primary", "rays");
  return input;
}

ExitCode code_of(const std::string& list, const DistributionInput& input) {
  try {
    (void)distributions_in(list, input);
  } catch (const Error& error) {
    return error.code();
  }
  return ExitCode::Done;
}

TEST(DistributionsIn, AllAreTheListsAndAuto) {
  std::vector<std::string> wanted;
  for (const Distribution distribution : kDistributions) wanted.emplace_back(name_of(distribution));
  wanted.emplace_back(kAutoDistribution);
  EXPECT_EQ(distributions_in("all", small_input()), wanted);
  EXPECT_EQ(distributions_in("auto,sort-last,auto", small_input()), (std::vector<std::string>{"auto", "sort-last"}));
  EXPECT_EQ(code_of("all,sort-last", small_input()), ExitCode::Usage);
  EXPECT_EQ(code_of("sort-lst", small_input()), ExitCode::Usage);
}

TEST(DistributionsIn, LeavesOutOfAllWhatTheSettingsExcludeButNotOfAList) {
  DistributionInput input = small_input();
  set_setting(input.settings, "data", "partitioned");
  EXPECT_EQ(distributions_in("sort-last,auto", input), (std::vector<std::string>{"sort-last", "auto"}));
  EXPECT_EQ(code_of("sort-first", input), ExitCode::Usage);
  const auto all = distributions_in("all", input);
  EXPECT_LT(all.size(), distributions_in("all", small_input()).size());
  EXPECT_EQ(all.back(), kAutoDistribution);
}

DistributionRun measure(int ranks, const std::string& distribution, const CheckFrame& check) {
  DistributionRun run;
  Globals globals;
  globals.threads = 1;
  const DistributionInput input = small_input();
  run_local_ranks(ranks, [&](Communicator& comm) {
    DistributionRun here = measure_distribution(comm, globals, input, distribution, {1, 2}, check);
    if (comm.rank() == 0) run = std::move(here);
  });
  return run;
}

TEST(MeasureDistribution, EveryDistributionMakesTheFrameOfOneRank) {
  WholeFrame reference;
  (void)measure(1, "sort-first", [&](const WholeFrame& frame) {
    reference = frame;
    return std::uint64_t{0};
  });
  ASSERT_EQ(reference.picture.size(), (Size{200, 70}));
  ASSERT_EQ(reference.keys.size(), (Size{200, 70}));
  const auto check = [&](const WholeFrame& frame) { return count_differing(frame, reference); };
  for (const std::string& name : distributions_in("all", small_input())) {
    const DistributionRun run = measure(3, name, check);
    EXPECT_EQ(run.differing_pixels, 0U) << name;
    EXPECT_EQ(run.ms.size(), 2U) << "warm-up does not count";
    EXPECT_EQ(run.memory_peak_bytes.size(), 3U);
    EXPECT_GT(run.bytes_total.front(), 0U);
    EXPECT_GE(run.imbalance.front(), 1.0);
    EXPECT_EQ(run.chosen.empty(), name != kAutoDistribution);
    const Distribution at_work = parse_distribution(run.chosen.empty() ? name : run.chosen);
    EXPECT_EQ(run.strategy == kNoStrategy, draws_alone(at_work)) << name;
    for (std::size_t i = 0; i < run.ms.size(); ++i) {
      EXPECT_GT(run.draw_ms[i], 0.0);
      EXPECT_GT(run.light_ms[i], 0.0);
      EXPECT_GT(run.collect_ms[i], 0.0);
      EXPECT_GE(run.exchange_ms[i], run.collect_ms[i]);
      if (run.strategy == kNoStrategy) continue;
      EXPECT_GT(run.composite_ms[i], 0.0);
      EXPECT_GT(run.exchange_ms[i], run.collect_ms[i]) << "keys move to the owners of tiles";
      EXPECT_LE(run.draw_ms[i] + run.composite_ms[i] + run.light_ms[i] + run.exchange_ms[i], run.ms[i] + 0.01) << name;
    }
  }
}

TEST(MeasureDistribution, ReportsTheWorstFrame) {
  std::uint64_t wrong = 9;
  const DistributionRun run = measure(1, "sort-last", [&](const WholeFrame& /*frame*/) { return wrong--; });
  EXPECT_EQ(run.differing_pixels, 9U);
  EXPECT_EQ(wrong, 7U) << "every measured frame is checked";
}

}  // namespace
}  // namespace hpr
