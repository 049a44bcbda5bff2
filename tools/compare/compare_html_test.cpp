#include <gtest/gtest.h>

#include "tools/compare/compare_report.h"
#include "tools/compare/schedule_drawing.h"

namespace hpr {
namespace {

CompareRun run_of(const std::string& strategy, int ranks, double ms, std::uint64_t bytes) {
  CompareRun run;
  run.strategy = strategy;
  run.ranks = ranks;
  run.transport = "threads";
  run.frames = 3;
  run.ms = {ms / 2, ms, ms * 2, ms * 3};
  run.bytes_total = bytes;
  run.frame_xxh64 = "0123456789abcdef";
  return run;
}

CompareReport report_of(std::vector<CompareRun> runs) {
  CompareReport report;
  report.command = "hpr compare --synthetic dense";
  report.machine = {"a cpu", 4, "an MPI"};
  report.screen = {64, 48};
  report.grid = {1, 1};
  report.input = "dense";
  report.runs = std::move(runs);
  return report;
}

std::size_t count(std::string_view text, std::string_view part) {
  std::size_t found = 0;
  for (std::size_t at = text.find(part); at != std::string_view::npos; at = text.find(part, at + 1)) ++found;
  return found;
}

TEST(CompareHtml, NothingFromOutsideIsMarkup) {
  const std::string evil = "<script>alert('1')</script>\"&";
  CompareReport report = report_of({run_of(evil, 2, 1.0, 10)});
  report.command = report.input = report.machine.cpu = report.machine.mpi = evil;
  report.runs.front().transport = report.runs.front().frame_xxh64 = evil;
  const std::string page = compare_html(report, {{evil, 0, "", evil}});
  EXPECT_EQ(count(page, "<script"), 0U);
  EXPECT_GE(count(page, "&lt;script&gt;alert(&#39;1&#39;)&lt;/script&gt;&quot;&amp;"), 11U);
}

TEST(CompareHtml, HasWhatWasMeasuredWhereAndHow) {
  CompareReport report = report_of({run_of("tree", 2, 1.5, 10), run_of("ring", 2, 2.5, 10), run_of("tree", 5, 3.5, 0)});
  report.runs[1].differing_pixels = 77;
  report.runs[2].predicted_ms = 4.25;
  report.runs[2].chosen = "ring";
  const std::string page = compare_html(report, {{"tree", 2, "<svg>drawn</svg>", ""}, {"ring", 0, "", "Not drawn."}});
  for (const char* part : {"a cpu", "an MPI", "hpr compare --synthetic dense", "4, oversubscribed", "64x48",
                           "On 2 ranks <strong>tree</strong> is the fastest: 1.500 ms",
                           "On 5 ranks <strong>tree</strong> is the fastest: 3.500 ms", "1 run differs",
                           "<td class=\"wrong\">77</td>", "<td>4.250</td>", "<svg>drawn</svg>", "tree on 2 ranks</h3>",
                           "<h3>ring</h3>", "<p>Not drawn.</p>", "<th scope=\"row\">tree (ring)</th>"}) {
    EXPECT_EQ(count(page, part), 1U) << part;
  }
  EXPECT_EQ(count(page, "<td>–</td>"), 2U);
  EXPECT_EQ(count(page, "<tr class=\"fastest\">"), 2U);
  EXPECT_EQ(count(page, "http"), 2U) << "the namespaces of the plots are the only addresses";
  report.machine.cores = 5;
  report.runs[1].differing_pixels = 0;
  const std::string other = compare_html(report, {});
  EXPECT_EQ(count(other, "4, oversubscribed"), 0U);
  EXPECT_EQ(count(other, "Every frame of every run is right"), 1U);
}

TEST(ComparePlots, HaveAMarkForEveryRunAndAHollowOneForEveryPrediction) {
  // The first two strategies have circles and squares.
  std::vector<CompareRun> runs{run_of("tree", 1, 1.0, 0), run_of("tree", 2, 2.0, 5'000'000), run_of("tree", 4, 3.0, 0),
                               run_of("ring", 2, 2.0, 5'000'000)};
  runs[1].predicted_ms = 2.5;
  const std::string over_ranks = plot_time_over_ranks(runs);
  EXPECT_EQ(count(over_ranks, "<circle"), 3U + 1U + 1U) << "runs, a prediction, the name's mark";
  EXPECT_EQ(count(over_ranks, "<rect"), 1U + 1U + 1U) << "paper, a run, the name's mark";
  EXPECT_EQ(count(over_ranks, "fill=\"#ffffff\" stroke=\"#332288\""), 1U);
  EXPECT_EQ(count(over_ranks, ">ring</text>"), 1U);
  const std::string against_bytes = plot_time_against_bytes(runs);
  EXPECT_EQ(count(against_bytes, "<circle"), 2U + 1U) << "without the run on one rank";
  EXPECT_EQ(count(against_bytes, ">0</text>"), 1U) << "where nothing is sent";
}

TEST(ComparePlots, TimesOfZeroAndManyStrategiesStayOnThePaper) {
  std::vector<CompareRun> runs{run_of("none", 2, 0.0, 0)};
  for (int i = 0; i < 60; ++i) runs.push_back(run_of("strategy" + std::to_string(i), 2, 1.0 + i, 1000));
  for (const std::string& plot : {plot_time_over_ranks(runs), plot_time_against_bytes(runs),
                                  plot_time_over_ranks({runs.front()}), plot_time_against_bytes({runs.front()})}) {
    EXPECT_EQ(count(plot, "nan"), 0U);
    EXPECT_EQ(count(plot, "inf"), 0U);
    EXPECT_EQ(count(plot, "=\"-"), 0U) << "no negative coordinate";
  }
}

TEST(DrawStrategies, DrawsEachOnceOnTheMostRanksUpToSixteenThatItRanOn) {
  const auto drawings =
      draw_strategies({run_of("tree", 2, 1.0, 1), run_of("radix-k:4,2", 8, 1.0, 1), run_of("tree", 3, 1.0, 1),
                       run_of("ring", 40, 1.0, 1), run_of("radix-k:5,5", 25, 1.0, 1)});
  ASSERT_EQ(drawings.size(), 4U);
  EXPECT_EQ(drawings[0].strategy, "tree");
  EXPECT_EQ(drawings[0].ranks, 3);
  EXPECT_EQ(count(drawings[0].svg, ">rank 2</text>"), 1U);
  EXPECT_EQ(count(drawings[0].svg, ">rank 3</text>"), 0U);
  EXPECT_EQ(drawings[1].ranks, 8);
  EXPECT_EQ(drawings[2].ranks, 16);
  EXPECT_EQ(drawings[3].remark, "It runs on no number of ranks up to 16 compared here.");
  EXPECT_TRUE(drawings[3].svg.empty());
}

TEST(DrawStrategies, SaysWhatWasChosenOrThatNothingIsMergedInPlaceOfADrawing) {
  std::vector<CompareRun> runs{run_of("auto", 2, 1.0, 1), run_of("auto", 3, 1.0, 1), run_of("auto", 4, 1.0, 1),
                               run_of("sort-first", 4, 1.0, 1)};
  runs[0].chosen = runs[2].chosen = "tree";
  runs[1].chosen = "ring";
  const auto drawings = draw_strategies(runs);
  ASSERT_EQ(drawings.size(), 2U);
  EXPECT_EQ(drawings[0].remark, "It chose tree, ring.");
  EXPECT_EQ(drawings[1].remark, "Every rank draws tiles of its own: only the collect is left.");
  for (const StrategyDrawing& drawing : drawings) EXPECT_TRUE(drawing.svg.empty());
}

TEST(DrawSchedule, SaysInWordsWhatItDraws) {
  RecordedFrame frame{64, {2, 2, {{0, 1, 0, 0, false}, {1, 0, 1, 3 * 32768 + 20, false}}, {}, {}}, {}};
  frame.collect.ranks = 2;
  const std::string svg = draw_schedule("mine & <yours>", frame);
  EXPECT_EQ(count(svg, "<title>mine &amp; &lt;yours&gt; on 2 ranks: who sends what to whom</title>"), 1U);
  EXPECT_EQ(count(svg, "<desc>composite: round 1: 1 × empty, 1 to 0; round 2: 1 × 3 tiles, 0 to 1; </desc>"), 1U);
  EXPECT_EQ(count(svg, "<polygon"), 2U) << "two heads of arrows";
}

}  // namespace
}  // namespace hpr
