#include "engine/samples.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "core/error.h"

namespace hpr {
namespace {

TEST(SampleGoal, IsANumberATimeOrAnError) {
  EXPECT_EQ(parse_sample_goal("16").samples, std::uint32_t{16});
  EXPECT_TRUE(parse_sample_goal("1").one());
  const SampleGoal time = parse_sample_goal("until:1.5s");
  EXPECT_EQ(time.seconds, 1.5);
  EXPECT_FALSE(time.samples || time.relmse);
  const SampleGoal error = parse_sample_goal("until:relmse=1e-3");
  EXPECT_EQ(error.relmse, 1e-3);
  EXPECT_FALSE(error.samples || error.seconds);
  for (const char* const text : {"", "0", "-1", "1.5", "4x", "4294967295", "99999999999", "until:", "until:0s",
                                 "until:relmse=", "until:relmse=0", "until:relmse=-1", "until:relmse=nan", "until:x"}) {
    try {
      (void)parse_sample_goal(text);
      ADD_FAILURE() << text;
    } catch (const Error& refused) {
      EXPECT_EQ(refused.code(), ExitCode::Usage) << text;
    }
  }
}

TEST(Samples, OneSampleWithoutAFilterLooksThroughTheCentre) {
  const Sampling plain{parse_sample_goal("1"), {}};
  EXPECT_FALSE(plain.sums());
  EXPECT_EQ(look_through(plain, {}, 0).offset, glm::dvec2(0.0));
  const Sampling filtered{parse_sample_goal("1"), PixelFilter::Gaussian};
  EXPECT_TRUE(filtered.sums());
  EXPECT_NE(look_through(filtered, {}, 0).offset, glm::dvec2(0.0));
}

TEST(Samples, EverySixteenSamplesFallIntoEverySixteenthOfThePixel) {
  const Sampling box{parse_sample_goal("64"), {}};
  for (const std::uint64_t seed : {1U, 2U, 9U}) {
    for (std::uint32_t first = 0; first < 64; first += 16) {
      for (int columns = 1; columns <= 16; columns *= 2) {
        std::vector<int> hits(16, 0);
        for (std::uint32_t i = first; i < first + 16; ++i) {
          const glm::dvec2 u = look_through(box, {.seed = seed, .frame = 0}, i).offset + 0.5;
          const int rows = 16 / columns;
          ++hits.at(static_cast<std::size_t>(std::floor(u.x * columns) * rows + std::floor(u.y * rows)));
        }
        for (const int count : hits) EXPECT_EQ(count, 1) << seed << ' ' << first << ' ' << columns;
      }
    }
  }
}

TEST(Samples, SeedsAndFramesLookElsewhere) {
  const Sampling box{parse_sample_goal("4"), {}};
  const glm::dvec2 one = look_through(box, {.seed = 1, .frame = 0}, 0).offset;
  EXPECT_NE(look_through(box, {.seed = 2, .frame = 0}, 0).offset, one);
  EXPECT_NE(look_through(box, {.seed = 1, .frame = 1}, 0).offset, one);
  EXPECT_EQ(look_through(box, {.seed = 1, .frame = 0}, 0).offset, one);
}

TEST(Samples, MitchellsWeightsSumToMoreThanZeroFromSixteenOn) {
  const Sampling mitchell{parse_sample_goal("16"), PixelFilter::Mitchell};
  int negative = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    double sum = 0.0;
    for (std::uint32_t i = 0; i < 80; ++i) {
      const double weight = look_through(mitchell, {.seed = seed, .frame = 0}, i).weight;
      negative += weight < 0.0;
      sum += weight;
      if (i < 15) continue;
      ASSERT_GE(sum, 4.0) << seed << ' ' << i;
    }
  }
  EXPECT_GT(negative, 500) << "the filter has negative lobes";
  EXPECT_THROW(check_sampling({parse_sample_goal("15"), PixelFilter::Mitchell}), Error);
  check_sampling(mitchell);
  check_sampling({parse_sample_goal("until:1s"), PixelFilter::Mitchell});
  EXPECT_FALSE(reached({parse_sample_goal("until:1s"), PixelFilter::Mitchell}, {15, 9.0, {}}));
}

TEST(Samples, MilestonesAreQuartersOfPowersOfTwo) {
  std::vector<std::uint32_t> found;
  for (std::uint32_t i = 0; i <= 40; ++i) {
    if (is_milestone(i)) found.push_back(i);
  }
  EXPECT_EQ(found, (std::vector<std::uint32_t>{1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24, 28, 32, 40}));
}

TEST(Samples, GoalsAreReachedAndTheRestIsGuessed) {
  const Sampling count{parse_sample_goal("8"), {}};
  EXPECT_FALSE(reached(count, {7, 100.0, 0.0}));
  EXPECT_TRUE(reached(count, {8, 0.0, {}}));
  EXPECT_DOUBLE_EQ(seconds_left(count.goal, {2, 3.0, {}}).value(), 9.0);
  const Sampling time{parse_sample_goal("until:2s"), {}};
  EXPECT_FALSE(reached(time, {1, 1.9, {}}));
  EXPECT_TRUE(reached(time, {1, 2.0, {}}));
  EXPECT_DOUBLE_EQ(seconds_left(time.goal, {1, 0.5, {}}).value(), 1.5);
  const Sampling error{parse_sample_goal("until:relmse=0.01"), {}};
  EXPECT_FALSE(reached(error, {32, 0.0, {}}));
  EXPECT_FALSE(reached(error, {32, 0.0, 0.02}));
  EXPECT_FALSE(reached(error, {8, 0.0, 0.001})) << "so few samples are not believed";
  EXPECT_TRUE(reached(error, {32, 0.0, 0.01}));
  EXPECT_DOUBLE_EQ(seconds_left(error.goal, {32, 5.0, 0.04}).value(), 15.0);
  EXPECT_FALSE(seconds_left(error.goal, {32, 5.0, {}}));
}

}  // namespace
}  // namespace hpr
