#include "tools/compare/distributions/distribution_report.h"

#include <gtest/gtest.h>

#include "core/json.h"

namespace hpr {
namespace {

DistributionRun run_of(const std::string& distribution, int ranks, double ms) {
  DistributionRun run;
  run.distribution = distribution;
  run.ranks = ranks;
  run.transport = "mpi";
  run.ms = {ms / 2, ms, ms * 2};
  run.draw_ms.assign(3, 0.3 * ms);
  run.composite_ms.assign(3, 0.2 * ms);
  run.light_ms.assign(3, 0.3 * ms);
  run.exchange_ms.assign(3, 0.1 * ms);
  run.collect_ms.assign(3, 0.05 * ms);
  run.imbalance = {1.1, 1.2, 1.3};
  run.bytes_total = {1'000'000, 2'000'000, 9'000'000};
  run.bytes_max_rank = {500'000, 500'000, 500'000};
  run.messages_total = {3, 4, 9};
  run.memory_peak_bytes.assign(static_cast<std::size_t>(ranks), 50'000'000);
  run.memory_peak_bytes.back() = 70'000'000;
  run.frame_xxh64 = "0123456789abcdef";
  run.picture_xxh64 = "fedcba9876543210";
  return run;
}

DistributionReport report_of(std::vector<DistributionRun> runs) {
  DistributionReport report;
  report.command = "hpr compare gen:gallery --distribute all";
  report.machine = {"a cpu", 2, "an MPI"};
  report.screen = {64, 48};
  report.grid = {1, 1};
  report.input = "gen:gallery";
  report.runs = std::move(runs);
  return report;
}

std::size_t count(std::string_view text, std::string_view part) {
  std::size_t found = 0;
  for (std::size_t at = text.find(part); at != std::string_view::npos; at = text.find(part, at + 1)) ++found;
  return found;
}

TEST(DistributionReport, JsonHasWhatRowsOfStrategiesHaveAndTheStages) {
  DistributionReport report = report_of({run_of("sort-last", 2, 10.0), run_of("auto", 2, 20.0)});
  report.runs[0].predicted_ms = 8.5;
  report.runs[1].chosen = "hybrid";
  const Json json = Json::parse(distribution_json(report));
  EXPECT_EQ(json.at("schema").string(), "hpr.compare/1");
  const Json& row = json.at("runs").elements().at(0);
  EXPECT_EQ(row.at("distribution").string(), "sort-last");
  EXPECT_EQ(value_at(row, "ms.median").get<double>(), 10.0);
  EXPECT_EQ(value_at(row, "ms.max").get<double>(), 20.0);
  EXPECT_DOUBLE_EQ(value_at(row, "ms_draw.median").get<double>(), 3.0);
  EXPECT_DOUBLE_EQ(value_at(row, "ms_composite.median").get<double>(), 2.0);
  EXPECT_DOUBLE_EQ(value_at(row, "ms_light.median").get<double>(), 3.0);
  EXPECT_DOUBLE_EQ(value_at(row, "ms_exchange.median").get<double>(), 1.0);
  EXPECT_DOUBLE_EQ(value_at(row, "ms_collect.median").get<double>(), 0.5);
  EXPECT_EQ(row.at("imbalance").get<double>(), 1.2);
  EXPECT_EQ(row.at("bytes_total").get<std::uint64_t>(), 2'000'000U);
  EXPECT_EQ(row.at("messages_total").get<int>(), 4);
  EXPECT_EQ(row.at("memory_peak_bytes_per_rank").get<std::vector<std::uint64_t>>(),
            (std::vector<std::uint64_t>{50'000'000, 70'000'000}));
  EXPECT_EQ(row.at("memory_of").string(), "rank");
  EXPECT_EQ(row.at("predicted_ms").get<double>(), 8.5);
  EXPECT_EQ(row.at("frames").get<int>(), 3);
  EXPECT_FALSE(row.contains("chosen"));
  EXPECT_FALSE(row.contains("name"));
  const Json& second = json.at("runs").elements().at(1);
  EXPECT_EQ(second.at("chosen").string(), "hybrid");
  EXPECT_TRUE(second.at("predicted_ms").is_null());
}

TEST(DistributionReport, TableSaysWhatAutoChoseAndWhoseMemoryItIs) {
  DistributionReport report = report_of({run_of("auto", 2, 10.0)});
  report.runs[0].chosen = "sort-first";
  std::string text = distribution_table(report);
  EXPECT_EQ(count(text, "auto (sort-first)"), 1U) << text;
  EXPECT_EQ(count(text, "70.0"), 1U) << text;
  EXPECT_EQ(count(text, "one process"), 0U);
  report.runs[0].memory_of = kMemoryOfProcess;
  EXPECT_EQ(count(distribution_table(report), "one process"), 1U);
  EXPECT_EQ(count(distribution_csv(report), "\n"), 2U);
  EXPECT_EQ(count(distribution_csv(report), "70000000"), 1U);
}

TEST(DistributionHtml, HasAPartForEveryStageAndAMarkForEveryPrediction) {
  DistributionReport report =
      report_of({run_of("sort-first", 1, 40.0), run_of("sort-first", 2, 30.0), run_of("sort-last", 2, 20.0)});
  report.runs[1].predicted_ms = 25.0;
  const std::string plot = plot_stages(report);
  for (const char* color : {"#77AADD", "#EE8866", "#EEDD88", "#99DDFF", "#DDDDDD"}) {
    EXPECT_EQ(count(plot, color), 3U + 1U) << color << ": bars and the legend";
  }
  EXPECT_EQ(count(plot, "<circle"), 1U + 1U) << "a prediction and the legend";
  EXPECT_EQ(count(plot, ">1 rank</text>"), 1U);
  EXPECT_EQ(count(plot, ">2 ranks</text>"), 1U);
  EXPECT_EQ(count(plot, ">predicted</text>"), 1U);
  report.runs[1].predicted_ms.reset();
  EXPECT_EQ(count(plot_stages(report), ">predicted</text>"), 0U);
  EXPECT_EQ(count(plot_memory(report), "#BBCC33"), 3U);

  const std::string page = distribution_html(report);
  EXPECT_EQ(count(page, "On 1 rank <strong>sort-first</strong> is the fastest: 40.00 ms"), 1U);
  EXPECT_EQ(count(page, "On 2 ranks <strong>sort-last</strong> is the fastest: 20.00 ms"), 1U);
  EXPECT_EQ(count(page, "<tr class=\"fastest\">"), 2U);
  EXPECT_EQ(count(page, "key by key and pixel by pixel"), 1U);
  EXPECT_EQ(count(page, "http"), 2U) << "the namespaces of the plots are the only addresses";
  EXPECT_EQ(count(page, "<td>–</td>"), 3U) << "without a prediction";
}

TEST(DistributionHtml, SaysWhatIsWrong) {
  DistributionReport report = report_of({run_of("sort-first", 2, 40.0), run_of("sort-last", 2, 20.0)});
  EXPECT_TRUE(report.frames_agree());
  report.runs[1].differing_pixels = 77;
  EXPECT_FALSE(report.frames_agree());
  const std::string page = distribution_html(report);
  EXPECT_EQ(count(page, "<td class=\"wrong\">77</td>"), 1U);
  EXPECT_EQ(count(page, "1 run differs"), 1U);
}

TEST(DistributionHtml, NothingFromOutsideIsMarkup) {
  const std::string evil = "<script>alert('1')</script>\"&";
  DistributionReport report = report_of({run_of(evil, 2, 1.0)});
  report.command = report.input = report.machine.cpu = report.machine.mpi = evil;
  report.runs[0].chosen = report.runs[0].strategy = report.runs[0].transport = report.runs[0].frame_xxh64 = evil;
  const std::string page = distribution_html(report);
  EXPECT_EQ(count(page, "<script"), 0U);
  EXPECT_GE(count(page, "&lt;script&gt;"), 8U);
}

TEST(DistributionPlots, TimesOfZeroAndManyRunsStayOnThePaper) {
  std::vector<DistributionRun> runs;
  for (int ranks = 1; ranks <= 64; ranks *= 2) {
    for (const char* name : {"sort-first", "sort-last", "hybrid"}) runs.push_back(run_of(name, ranks, 1e-3 * ranks));
  }
  for (const DistributionReport& report : {report_of({run_of("auto", 1, 0.0)}), report_of(runs)}) {
    for (const std::string& plot : {plot_stages(report), plot_memory(report)}) {
      EXPECT_EQ(count(plot, "nan"), 0U);
      EXPECT_EQ(count(plot, "inf"), 0U);
      EXPECT_EQ(count(plot, "=\"-"), 0U) << "no negative coordinate";
    }
  }
}

}  // namespace
}  // namespace hpr
