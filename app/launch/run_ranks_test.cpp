#include "app/launch/run_ranks.h"

#include <gtest/gtest.h>

namespace hpr {
namespace {

using std::chrono::minutes;

TEST(RestartLimit, RefillsWithTime) {
  RestartLimit limit(2);
  const RestartLimit::Clock::time_point begin;
  EXPECT_TRUE(limit.use(begin));
  EXPECT_TRUE(limit.use(begin + minutes(30)));
  EXPECT_EQ(limit.used(), 2U);
  EXPECT_FALSE(limit.use(begin + minutes(59))) << "two within an hour";
  EXPECT_TRUE(limit.use(begin + minutes(60))) << "the first is an hour old";
  EXPECT_FALSE(limit.use(begin + minutes(89)));
  EXPECT_TRUE(limit.use(begin + minutes(90)));
  EXPECT_TRUE(limit.use(begin + minutes(1000)));
  EXPECT_EQ(limit.used(), 1U);
}

TEST(RestartLimit, OfNoneIsNone) {
  RestartLimit limit(0);
  EXPECT_FALSE(limit.use({}));
  EXPECT_FALSE(limit.use(RestartLimit::Clock::time_point(minutes(1000))));
}

}  // namespace
}  // namespace hpr
