#include "tools/sweep.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

namespace hpr {
namespace {

TEST(SpreadOf, TakesTheMiddleAndTheNearestRank) {
  const Spread one = spread_of({3.0});
  EXPECT_EQ(one.min, 3.0);
  EXPECT_EQ(one.p95, 3.0);
  const Spread even = spread_of({4.0, 1.0, 3.0, 2.0});
  EXPECT_EQ(even.median, 2.5);
  std::vector<double> many;
  for (int i = 100; i >= 1; --i) many.push_back(i);
  const Spread hundred = spread_of(many);
  EXPECT_EQ(hundred.min, 1.0);
  EXPECT_EQ(hundred.p95, 95.0);
  EXPECT_EQ(hundred.max, 100.0);
}

TEST(Median, IsTheMeanOfTheTwoInTheMiddle) {
  EXPECT_EQ(median({5.0, 1.0, 3.0}), 3.0);
  EXPECT_EQ(median({4.0, 1.0, 3.0, 8.0}), 3.5);
}

TEST(MeasureInTurns, EachContenderRunsOnceARoundAndWarmUpDoesNotCount) {
  std::vector<std::pair<std::size_t, bool>> calls;
  measure_in_turns(2, {1, 2}, [&](std::size_t contender, bool counts) { calls.emplace_back(contender, counts); });
  EXPECT_EQ(calls, (std::vector<std::pair<std::size_t, bool>>{
                       {0, false}, {1, false}, {0, true}, {1, true}, {0, true}, {1, true}}));
}

TEST(ShuffledRounds, EachRoundHasAllCasesInAnOrderOfItsOwnByTheSeed) {
  const std::vector<std::size_t> order = shuffled_rounds(20, 3, 7);
  ASSERT_EQ(order.size(), 60U);
  std::vector<std::vector<std::size_t>> rounds;
  for (auto first = order.begin(); first != order.end(); first += 20) {
    auto sorted = rounds.emplace_back(first, first + 20);
    std::ranges::sort(sorted);
    for (std::size_t i = 0; i < sorted.size(); ++i) EXPECT_EQ(sorted[i], i);
  }
  EXPECT_NE(rounds[0], rounds[1]);
  EXPECT_NE(rounds[1], rounds[2]);
  EXPECT_EQ(order, shuffled_rounds(20, 3, 7));
  EXPECT_NE(order, shuffled_rounds(20, 3, 8));
}

TEST(FramesOfRound, AddUpToAllFrames) {
  EXPECT_EQ(frames_of_round(10, 3, 0), 4);
  EXPECT_EQ(frames_of_round(10, 3, 1), 3);
  EXPECT_EQ(frames_of_round(10, 3, 2), 3);
  EXPECT_EQ(frames_of_round(1, 1, 0), 1);
}

TEST(MedianTimes, AreOfEachContenderOnTheClockThatIsGiven) {
  static double now = 0.0;
  const auto clock = [] { return now; };
  const std::vector<double> medians =
      median_times({[] { now += 2.0; }, [] { now += 5.0; }}, {1, 3}, static_cast<double (*)()>(clock));
  EXPECT_EQ(medians, (std::vector{2.0, 5.0}));
}

TEST(MeasureCases, EndWhereOneStopsOrFails) {
  const auto count = [](std::size_t stops_at, bool failed) {
    std::vector<std::size_t> named;
    const bool all = measure_cases(
        {"none", "case", 4},
        [&](std::size_t i) {
          named.push_back(i);
          return std::to_string(i);
        },
        [&](std::size_t i) { return CaseResult{.stop = i == stops_at && !failed, .failed = i == stops_at && failed}; });
    return std::pair(all, named.size());
  };
  EXPECT_EQ(count(9, false), std::pair(true, std::size_t{4}));
  EXPECT_EQ(count(1, false), std::pair(false, std::size_t{2})) << "it was measured";
  EXPECT_EQ(count(1, true), std::pair(false, std::size_t{1})) << "it was not";
  EXPECT_EQ(count(3, false), std::pair(true, std::size_t{4})) << "nothing was left";
}

TEST(Counts, AreTakenOnceInTheirOrder) {
  EXPECT_EQ(parse_counts("4,2,4,2,1", "--ranks"), (std::vector{4, 2, 1}));
  EXPECT_THROW((void)parse_counts("4,0", "--ranks"), Error);
  EXPECT_EQ(powers_of_two_up_to(6), (std::vector{1, 2, 4, 6}));
  EXPECT_EQ(powers_of_two_up_to(8), (std::vector{1, 2, 4, 8}));
}

}  // namespace
}  // namespace hpr
