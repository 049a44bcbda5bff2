#include "engine/wall/slow_ranks.h"

#include <gtest/gtest.h>

namespace hpr {
namespace {

/// Frames of 100 ms each, one after the other.
class SlowRanks : public testing::Test {
 protected:
  std::vector<SlowRank> add(const std::vector<double>& ms, double frame_s = 0.1) {
    now_s_ += frame_s;
    std::vector<RankWork> works;
    for (const double each : ms) works.push_back({each, each, 2});
    return watch_.add(works, now_s_);
  }

  /// How many reports `frames` such frames bring.
  std::size_t count(const std::vector<double>& ms, int frames, double frame_s = 0.1) {
    std::size_t reports = 0;
    for (int i = 0; i < frames; ++i) reports += add(ms, frame_s).size();
    return reports;
  }

  SlowRankWatch watch_;
  double now_s_ = 1000.0;
};

TEST_F(SlowRanks, TenSlowFramesInARowAreReportedOnceAndSoIsTheirEnd) {
  EXPECT_EQ(count({20, 20, 100, 20}, 9), 0U);
  const std::vector<SlowRank> found = add({20, 20, 100, 20});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].rank, 2);
  EXPECT_DOUBLE_EQ(found[0].ratio, 5.0);
  EXPECT_FALSE(found[0].is_over);
  EXPECT_EQ(count({20, 20, 100, 20}, 30), 0U);
  const std::vector<SlowRank> over = add({20, 20, 21, 20});
  ASSERT_EQ(over.size(), 1U);
  EXPECT_TRUE(over[0].is_over);
  EXPECT_NEAR(over[0].seconds, 4.0, 1e-9);
  EXPECT_EQ(over[0].pass, 2U);
  EXPECT_EQ(count({20, 20, 21, 20}, 30), 0U);
}

TEST_F(SlowRanks, AFrameBetweenBeginsAnew) {
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(count({20, 100, 20}, 9), 0U);
    EXPECT_EQ(count({20, 20, 20}, 1), 0U);
  }
}

TEST_F(SlowRanks, FewLongFramesTakeFiveSeconds) {
  EXPECT_EQ(count({400, 2000, 400}, 2, 2.0), 0U);
  EXPECT_EQ(count({400, 2000, 400}, 1, 2.0), 1U);
}

TEST_F(SlowRanks, NeitherAFewMillisecondsNorLessThanFourTimesAsLongCount) {
  EXPECT_EQ(count({1, 1, 50, 1}, 30), 0U);
  EXPECT_EQ(count({100, 100, 400, 100}, 30), 0U);
  EXPECT_EQ(count({1, 1, 51.5, 1}, 30), 1U);
}

TEST_F(SlowRanks, OfTwoRanksEachIsComparedWithTheOther) {
  EXPECT_EQ(count({20, 100}, 10), 1U);
  EXPECT_EQ(count({20, 20}, 1), 1U);
  EXPECT_EQ(count({5, 100, 100}, 30), 0U) << "an idle rank makes the others no slower";
  EXPECT_EQ(count({500}, 30), 0U);
}

TEST_F(SlowRanks, ARankThatIsSlowNowAndThenIsReportedOnceAMinute) {
  EXPECT_EQ(count({20, 100, 20}, 10), 1U);
  std::size_t reports = 0;
  for (int i = 0; i < 46; ++i) reports += count({20, 20, 20}, 1) + count({20, 100, 20}, 12);  // 59.8 s
  EXPECT_EQ(reports, 1U) << "the end of the first";
  EXPECT_EQ(count({20, 20, 20}, 1) + count({20, 100, 20}, 12), 1U);
  // Within one streak too.
  EXPECT_EQ(count({20, 100, 20}, 590), 0U);
  EXPECT_EQ(count({20, 100, 20}, 20), 1U);
}

TEST_F(SlowRanks, AreDescribedWithHostAndPass) {
  EXPECT_EQ(describe({3, 6.24, 14.2, 1, true}, "wall02", "raster"),
            "rank 3 on wall02 was 6.2 times slower than the others for 14 s, in raster");
  EXPECT_EQ(describe({3, 6.24, 14.2, 1, false}, "wall02", "shadow"),
            "rank 3 on wall02 is 6.2 times slower than the others for 14 s so far, in shadow");
}

}  // namespace
}  // namespace hpr
