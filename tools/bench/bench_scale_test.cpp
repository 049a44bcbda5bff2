#include "tools/bench/bench_scale.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/json.h"
#include "tools/sweep.h"

namespace hpr {
namespace {

ScaleRun run_of(Size grid, int ranks, int threads, std::vector<double> ms) {
  ScaleRun run;
  run.grid = grid;
  run.ranks = ranks;
  run.threads = threads;
  run.ms = std::move(ms);
  run.rank_ms.assign(static_cast<std::size_t>(ranks), 5.0);
  run.bytes_sent = 1000;
  run.frame_xxh64 = grid.width == 1 ? "0123456789abcdef" : "fedcba9876543210";
  return run;
}

ScaleReport report_of(std::vector<ScaleRun> runs) {
  return {"hpr bench scale", {"a cpu", 4, "an MPI"}, "gen:cornell", {64, 48}, 1, std::move(runs)};
}

/// The least cores come last, and each wall has its own.
ScaleReport example() {
  return report_of({run_of({1, 1}, 4, 1, {10, 11, 30}), run_of({1, 1}, 2, 1, {20, 22, 21}),
                    run_of({2, 2}, 2, 2, {30, 30, 30}), run_of({2, 2}, 1, 2, {60, 60, 60}),
                    run_of({1, 1}, 1, 1, {40, 44, 48})});
}

TEST(BenchScale, SpeedUpIsAgainstTheLeastCoresOfTheSameWall) {
  const ScaleReport report = example();
  const ScaleFigures four = figures_of(report, report.runs[0]);
  EXPECT_EQ(four.median_ms, 11.0);
  EXPECT_EQ(four.speed_up, 4.0);
  EXPECT_EQ(four.efficiency, 1.0);
  EXPECT_EQ(figures_of(report, report.runs[4]).speed_up, 1.0);
  const ScaleFigures wall = figures_of(report, report.runs[2]);
  EXPECT_EQ(wall.speed_up, 2.0);
  EXPECT_EQ(wall.efficiency, 1.0) << "four cores against two";
}

TEST(BenchScale, TheMedianHasAnInterval) {
  std::vector<double> ms(100);
  for (std::size_t i = 0; i < ms.size(); ++i) ms[i] = static_cast<double>(i + 1);
  std::ranges::reverse(ms);
  const ScaleReport report = report_of({run_of({1, 1}, 1, 1, ms)});
  const ScaleFigures figures = figures_of(report, report.runs[0]);
  EXPECT_EQ(figures.median_ms, 50.5);
  EXPECT_EQ(figures.low_ms, 41.0);  // the orders that hold the median in 95 of 100: 40.2 and 60.8
  EXPECT_EQ(figures.high_ms, 61.0);
  const ScaleReport few = report_of({run_of({1, 1}, 1, 1, {3, 1})});
  EXPECT_EQ(figures_of(few, few.runs[0]).low_ms, 1.0);
  EXPECT_EQ(figures_of(few, few.runs[0]).high_ms, 3.0);
}

TEST(BenchScale, RanksThatHoldUpTheOthersAreNamed) {
  ScaleReport report = example();
  EXPECT_TRUE(slow_ranks(report).empty());
  report.runs[0].rank_ms = {5, 5, 9, 5};
  ASSERT_EQ(slow_ranks(report).size(), 1U);
  EXPECT_TRUE(slow_ranks(report)[0].starts_with("rank 2 of 4 with 1 cores was busy for 9.0 ms of a frame of 1x1"))
      << slow_ranks(report)[0];
  EXPECT_EQ(figures_of(report, report.runs[0]).imbalance, 1.5);
  report.runs[1].rank_ms = {1, 9};
  EXPECT_EQ(slow_ranks(report).size(), 1U) << "of two, neither is the rule";
}

TEST(BenchScale, PicturesOfAWallAreToAgree) {
  ScaleReport report = example();
  EXPECT_TRUE(pictures_agree(report));
  report.runs[2].frame_xxh64 = report.runs[0].frame_xxh64;
  EXPECT_FALSE(pictures_agree(report));
}

TEST(BenchScale, FramesOfSeveralJobsAreOneRun) {
  std::vector<ScaleRun> runs;
  const std::vector<ScaleRun> first{run_of({2, 1}, 2, 3, {1.5, 2.5})};
  const std::string handed_over = Table(scale_job_columns(), std::span(first)).json().dump();
  append_frames(runs, rows_from_job(scale_job_columns(), handed_over));
  append_frames(runs, {run_of({2, 1}, 2, 3, {4.0})});
  ASSERT_EQ(runs.size(), 1U);
  EXPECT_EQ(runs[0].ms, (std::vector{1.5, 2.5, 4.0}));
  EXPECT_EQ(runs[0].grid, (Size{2, 1}));
  EXPECT_EQ(runs[0].threads, 3);
  EXPECT_EQ(runs[0].bytes_sent, 1000U);
  EXPECT_EQ(runs[0].frame_xxh64, "fedcba9876543210");
  ScaleRun other = runs[0];
  other.frame_xxh64 = "0";
  append_frames(runs, {other});
  EXPECT_FALSE(pictures_agree(report_of(runs)));
  EXPECT_TRUE(Json::parse(scale_json(report_of(runs)))["runs"][0]["frame_xxh64"].is_null());
}

TEST(BenchScale, MoreThreadsThanCoresAreTold) {
  const ScaleReport report = report_of({run_of({1, 1}, 4, 1, {1}), run_of({1, 1}, 4, 2, {1})});
  EXPECT_FALSE(report.oversubscribed(report.runs[0]));
  EXPECT_TRUE(report.oversubscribed(report.runs[1]));
  ScaleRun two_hosts = report.runs[1];
  two_hosts.hosts = 2;
  EXPECT_FALSE(report.oversubscribed(two_hosts));
  EXPECT_NE(scale_table(report).find("more than the machine's cores"), std::string::npos);
}

TEST(BenchScale, ReportsHoldEveryRunAndEveryFrame) {
  const ScaleReport report = example();
  const auto json = Json::parse(scale_json(report));
  EXPECT_EQ(json["schema"], "hpr.bench-scale/1");
  EXPECT_EQ(json["runs"].size(), 5U);
  EXPECT_EQ(json["runs"][0]["speed_up"], 4.0);
  EXPECT_EQ(json["runs"][2]["tiles"], "2x2");
  const std::string csv = scale_csv(report);
  EXPECT_EQ(std::ranges::count(csv, '\n'), 1 + 5 * 3);
  EXPECT_NE(csv.find("2x2,2,2,1,0,30.000000\n"), std::string::npos);
  EXPECT_EQ(std::ranges::count(scale_table(report), '\n'), 2 + 5);
}

TEST(BenchScale, ThePlotHasAMarkForEachRun) {
  const std::string page = scale_html(example());
  std::size_t circles = 0;
  for (std::size_t at = page.find("<circle"); at != std::string::npos; at = page.find("<circle", at + 1)) ++circles;
  EXPECT_EQ(circles, 5U);
  EXPECT_EQ(page.find("nan"), std::string::npos);
  const ScaleReport alone = report_of({run_of({1, 1}, 1, 1, {1})});
  EXPECT_EQ(plot_speed_up(alone).find("nan"), std::string::npos) << "one run has a place too";
  ScaleReport evil = example();
  evil.input = evil.command = "<script>";
  EXPECT_EQ(scale_html(evil).find("<script>"), std::string::npos);
}

}  // namespace
}  // namespace hpr
