#include "tools/compare/compare.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <mutex>

#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"
#include "compositing/compositor.h"
#include "compositing/kernels.h"
#include "compositing/model/synthetic.h"
#include "core/bytes.h"
#include "core/error.h"
#include "core/json.h"
#include "tools/compare/compare_report.h"

namespace hpr {
namespace {

CompareInput synthetic_input(SyntheticKind kind, Size screen, Size grid) {
  return {std::string(name_of(kind)), screen, grid, true,
          [=](Communicator& comm) { return synthetic_wall(kind, comm.rank(), screen, grid, 1); }};
}

CompareResult compare_on_threads(int ranks, const CompareInput& input, const CompareSettings& settings) {
  CompareResult result;
  run_local_ranks(ranks, [&](Communicator& comm) {
    CompareResult here = compare_strategies(comm, input, settings);
    if (comm.rank() == 0) {
      result = std::move(here);
    } else {
      EXPECT_TRUE(here.runs.empty());
    }
  });
  return result;
}

const CompareSettings kAllStrategies = [] {
  CompareSettings settings{{}, {1, 2}};
  for (const auto& compositor : all_compositors()) settings.strategies.emplace_back(compositor->name());
  return settings;
}();

TEST(Compare, FramesHaveTheirPublishedHashesWhateverTheStrategy) {
  const std::map<int, std::string> published{{1, "a83afd4778344dde"},
                                             {2, "b469c69167d7b622"},
                                             {3, "543c766d56a1a398"},
                                             {4, "618335226e690c83"},
                                             {8, "7e37d517cae2450a"}};
  for (const auto& [ranks, hash] : published) {
    const CompareResult result =
        compare_on_threads(ranks, synthetic_input(SyntheticKind::Dense, {333, 217}, {1, 1}), kAllStrategies);
    ASSERT_EQ(result.runs.size(), kAllStrategies.strategies.size());
    for (const CompareRun& run : result.runs) {
      EXPECT_EQ(run.frame_xxh64, hash) << run.strategy << " on " << ranks;
      EXPECT_EQ(run.differing_pixels, 0U);
      EXPECT_EQ(run.ranks, ranks);
      EXPECT_EQ(run.transport, "threads");
      EXPECT_EQ(run.frames, 2);
      EXPECT_LE(run.ms.min, run.ms.median);
      EXPECT_LE(run.ms.median, run.ms.max);
      EXPECT_GE(run.imbalance, 1.0);
      EXPECT_LE(run.imbalance, ranks);
    }
  }
}

TEST(Compare, AWallOfScreensShowsTheSameFrameAsOneScreen) {
  // 333 x 217 has no such parts, 64 x 48 has: 4 x 3 screens of 16 x 16.
  for (const SyntheticKind kind : all_synthetic_kinds()) {
    const auto whole = compare_on_threads(3, synthetic_input(kind, {64, 48}, {1, 1}), kAllStrategies);
    const auto parts = compare_on_threads(3, synthetic_input(kind, {16, 16}, {4, 3}), kAllStrategies);
    EXPECT_EQ(whole.runs.front().frame_xxh64, parts.runs.back().frame_xxh64) << name_of(kind);
    EXPECT_TRUE(whole.frame == parts.frame);
  }
}

TEST(Compare, CountsWhatIsSentInOneFrame) {
  // 16 dense tiles of 32 KiB; a head is 16 bytes and 2 for each. Serial sends two layers, and its collect nothing but
  // two empty messages.
  const auto result = compare_on_threads(3, synthetic_input(SyntheticKind::Dense, {256, 256}, {1, 1}),
                                         {{"serial", "mpi-reduce"}, {0, 3}});
  const CompareRun& serial = result.runs.front();
  EXPECT_EQ(serial.bytes_total, 2U * (16 * 32768 + 16 + 32));
  EXPECT_EQ(serial.bytes_max_rank, 16U * 32768 + 16 + 32);
  EXPECT_EQ(serial.messages_total, 4U);
  EXPECT_EQ(result.runs.back().bytes_total, 2U * 16 * 32768);
}

TEST(Compare, PredictsNothingOfARankThatHasNobodyToComposeWith) {
  for (const int ranks : {1, 2}) {
    const auto result =
        compare_on_threads(ranks, synthetic_input(SyntheticKind::Dense, {64, 48}, {1, 1}), kAllStrategies);
    for (const CompareRun& run : result.runs) {
      EXPECT_EQ(run.predicted_ms.has_value(), ranks > 1) << run.strategy << " on " << ranks;
    }
  }
}

TEST(Compare, SurfaceKeysAreHashedWhole) {
  CompareInput input = synthetic_input(SyntheticKind::Sparse, {100, 50}, {1, 1});
  input.colors = false;
  const auto result = compare_on_threads(2, input, {{"tree"}, {0, 1}});
  EXPECT_EQ(result.runs.front().frame_xxh64, hex16(xxh64(std::as_bytes(result.frame.pixels()))));
}

TEST(Compare, MeasuresEveryStrategyOnTheLayersOfTheCallback) {
  // The layers differ from call to call, so a strategy that asked again would be found out.
  std::mutex mutex;
  int calls = 0;
  CompareInput input = synthetic_input(SyntheticKind::Half, {100, 50}, {1, 1});
  input.layer = [&](Communicator& comm) {
    const std::lock_guard lock(mutex);
    return synthetic_layer(SyntheticKind::Half, comm.rank() + 100 * calls++, {100, 50}, 1);
  };
  const auto result = compare_on_threads(4, input, kAllStrategies);
  EXPECT_EQ(calls, 4);
  for (const CompareRun& run : result.runs) EXPECT_EQ(run.differing_pixels, 0U);
}

/// Damages the last pixel of what it receives while it also sends, which binary swap does and the check does not.
class DamagingCommunicator final : public ForwardingCommunicator {
 public:
  using ForwardingCommunicator::ForwardingCommunicator;
  using ForwardingCommunicator::receive;

  void receive(std::span<std::byte> message, int from) override {
    inner().receive(message, from);
    if (swaps_) std::fill_n(message.rbegin(), sizeof(Key), std::byte{0xFF});
  }
  void exchange(std::span<const Outgoing> out, std::span<const int> from, const Arrived& arrived) override {
    swaps_ = !out.empty();
    inner().exchange(out, from, arrived);
    swaps_ = false;
  }

 private:
  bool swaps_ = false;
};

TEST(Compare, CountsThePixelsAStrategyGetsWrong) {
  run_local_ranks(2, [](Communicator& comm) {
    DamagingCommunicator damaging(comm);
    const auto result = compare_strategies(damaging, synthetic_input(SyntheticKind::Dense, {128, 64}, {1, 1}),
                                           {{"serial", "tree", "binary-swap", "mpi-reduce"}, {1, 2}});
    for (const CompareRun& run : result.runs) EXPECT_EQ(run.differing_pixels, run.strategy == "binary-swap" ? 2U : 0U);
  });
}

/// Every third tile of the frame that all ranks' layers make, but for `missing`.
DrawnTiles every_third_tile(Communicator& comm, Size size, std::size_t missing) {
  DrawnTiles drawn{TileLayer<Key>(FrameLayout({size})), {}};
  for (int rank = 0; rank < comm.size(); ++rank) {
    const TileLayer<Key> layer = synthetic_layer(SyntheticKind::Dense, rank, size, 1);
    for (std::size_t tile = static_cast<std::size_t>(comm.rank()); tile < layer.tiles(); tile += 3) {
      if (tile == missing) continue;
      std::ranges::transform(layer.tile(tile), drawn.layer.tile(tile), drawn.layer.tile(tile).begin(),
                             [](Key a, Key b) { return std::max(a, b); });
      drawn.layer.set_active(tile);
      if (rank == 0) drawn.tiles.push_back(tile);
    }
  }
  return drawn;
}

TEST(Compare, SortFirstIsCheckedAgainstTheSameFrame) {
  for (const std::size_t missing : {std::size_t{99}, std::size_t{4}}) {
    CompareInput input = synthetic_input(SyntheticKind::Dense, {256, 128}, {1, 1});
    input.sort_first = [&](Communicator& comm) { return every_third_tile(comm, {256, 128}, missing); };
    const CompareResult result = compare_on_threads(3, input, {{"serial", kSortFirst}, {1, 2}});
    EXPECT_EQ(result.runs[0].differing_pixels, 0U);
    EXPECT_EQ(result.runs[1].strategy, "sort-first");
    EXPECT_EQ(result.runs[1].differing_pixels, missing == 4 ? kTilePixels : 0U);
    EXPECT_LT(result.runs[1].bytes_total, result.runs[0].bytes_total);
  }
}

CompareSettings every_blender(CompareOperator operation) {
  CompareSettings settings{{}, {1, 2}, operation};
  for (const auto& blender : all_blenders<RgbaPremultiplied>()) settings.strategies.emplace_back(blender->name());
  return settings;
}

TEST(Compare, TranslucentLayersAreHeldToTheSerialResult) {
  for (const SyntheticKind kind : all_synthetic_kinds()) {
    for (const CompareOperator operation : {CompareOperator::Over8, CompareOperator::OverFloat}) {
      const CompareSettings settings = every_blender(operation);
      const auto result = compare_on_threads(5, synthetic_input(kind, {100, 70}, {2, 1}), settings);
      ASSERT_EQ(result.runs.size(), settings.strategies.size());
      EXPECT_EQ(result.picture.size(), (Size{200, 70}));
      const double bound = operation == CompareOperator::Over8 ? over_error_bound<Rgba8Premultiplied>(5) / 255.0
                                                               : over_error_bound<RgbaPremultiplied>(5);
      for (const CompareRun& run : result.runs) {
        EXPECT_EQ(run.differing_pixels, 0U) << run.strategy;
        ASSERT_TRUE(run.max_error);
        EXPECT_LE(*run.max_error, 2.0 * bound) << run.strategy;
        if (run.strategy != "serial" && run.strategy != "direct-send" && run.strategy != "shared-memory") continue;
        EXPECT_EQ(*run.max_error, 0.0) << run.strategy;
        EXPECT_EQ(run.frame_xxh64, result.runs.front().frame_xxh64) << run.strategy;
      }
    }
  }
}

TEST(Compare, CountsTheTranslucentPixelsAStrategyGetsWrong) {
  run_local_ranks(2, [](Communicator& comm) {
    DamagingCommunicator damaging(comm);
    for (const CompareOperator operation : {CompareOperator::Over8, CompareOperator::OverFloat}) {
      const auto result = compare_strategies(damaging, synthetic_input(SyntheticKind::Dense, {128, 64}, {1, 1}),
                                             {{"serial", "tree", "binary-swap"}, {1, 2}, operation});
      for (const CompareRun& run : result.runs) {
        EXPECT_EQ(run.differing_pixels > 0, run.strategy == "binary-swap") << run.strategy;
      }
    }
  });
}

CompareReport example_report() {
  CompareReport report;
  report.command = "hpr compare --synthetic dense";
  report.machine = {"a cpu", 4, "Open MPI v4.1.4"};
  report.screen = {64, 48};
  report.grid = {3, 2};
  report.input = "dense";
  report.seed = 9;
  CompareRun run;
  run.strategy = "tree";
  run.ranks = 5;
  run.transport = "mpi";
  run.frames = 7;
  run.ms = {1.0, 2.0, 3.0, 4.0};
  run.ms_composite = 1.5;
  run.ms_collect = 0.5;
  run.bytes_total = 5'000'000'000;
  run.bytes_max_rank = 11;
  run.messages_total = 12;
  run.imbalance = 1.25;
  run.differing_pixels = 13;
  run.frame_xxh64 = "0123456789abcdef";
  report.runs = {run};
  return report;
}

TEST(CompareReport, JsonHasEveryKeyOfTheSchema) {
  const auto json = Json::parse(compare_json(example_report()));
  EXPECT_EQ(json.at("schema"), "hpr.compare/1");
  EXPECT_EQ(json.at("command"), "hpr compare --synthetic dense");
  EXPECT_FALSE(json.at("commit").get<std::string>().empty());
  EXPECT_EQ(json.at("machine").at("cpu"), "a cpu");
  EXPECT_EQ(json.at("machine").at("cores"), 4);
  EXPECT_EQ(json.at("machine").at("mpi"), "Open MPI v4.1.4");
  EXPECT_EQ(json.at("machine").at("oversubscribed"), true);
  EXPECT_EQ(json.at("image"), (Json{{"width", 64}, {"height", 48}, {"tiles", "3x2"}}));
  EXPECT_EQ(json.at("input"), "dense");
  EXPECT_EQ(json.at("seed"), 9);
  const auto expected = Json::parse(R"([{"strategy": "tree", "ranks": 5, "transport": "mpi", "frames": 7,
      "ms": {"min": 1.0, "median": 2.0, "p95": 3.0, "max": 4.0}, "ms_composite": {"median": 1.5},
      "ms_collect": {"median": 0.5}, "bytes_total": 5000000000, "bytes_max_rank": 11, "messages_total": 12,
      "imbalance": 1.25, "differing_pixels": 13, "frame_xxh64": "0123456789abcdef", "predicted_ms": null}])");
  EXPECT_EQ(json.at("runs"), expected);
}

TEST(CompareReport, JsonHasTheErrorOfTranslucentFrames) {
  CompareReport report = example_report();
  EXPECT_FALSE(Json::parse(compare_json(report)).at("runs")[0].contains("max_error"));
  report.operation = "over8";
  report.runs.front().max_error = 0.25;
  const auto json = Json::parse(compare_json(report));
  EXPECT_EQ(json.at("operator"), "over8");
  EXPECT_EQ(json.at("runs")[0].at("max_error"), 0.25);
}

TEST(CompareReport, RunsSurviveFromAJobToItsStarter) {
  CompareReport report = example_report();
  report.runs.push_back(report.runs.front());
  report.runs.back().strategy = "serial";
  report.runs.back().ms.median = 0.1 + 0.2;
  report.runs.back().max_error = 0.3;
  CompareReport back = report;
  const std::string text = Table(compare_columns(), std::span<const CompareRun>(report.runs)).json().dump();
  back.runs = rows_from_job(compare_columns(), text);
  EXPECT_EQ(compare_json(back), compare_json(report));
  for (const char* wrong : {"", "{}", "[{}]", "[{\"strategy\": 1}]", "["}) {
    EXPECT_THROW((void)rows_from_job(compare_columns(), wrong), Error) << wrong;
  }
}

TEST(CompareReport, CsvHasOneFieldPerColumn) {
  const std::string csv = compare_csv(example_report());
  const auto lines = std::ranges::count(csv, '\n');
  EXPECT_EQ(lines, 2);
  const std::string head = csv.substr(0, csv.find('\n'));
  const std::string row = csv.substr(csv.find('\n') + 1);
  EXPECT_EQ(std::ranges::count(head, ','), std::ranges::count(row, ','));
  EXPECT_TRUE(head.ends_with(",chosen"));
  EXPECT_TRUE(row.starts_with("tree,5,mpi,7,1.000000,2.000000,"));
  EXPECT_TRUE(row.ends_with(",\n"));
}

TEST(CompareReport, CsvQuotesWhatHoldsCommasOrQuotes) {
  CompareReport report = example_report();
  report.runs.front().strategy = "radix-k:2,2";
  report.runs.front().chosen = R"(a "plugin")";
  const std::string csv = compare_csv(report);
  const std::string row = csv.substr(csv.find('\n') + 1);
  EXPECT_TRUE(row.starts_with(R"("radix-k:2,2",5,mpi,7,)")) << row;
  EXPECT_TRUE(row.ends_with(",\"a \"\"plugin\"\"\"\n")) << row;
}

}  // namespace
}  // namespace hpr
