#include "core/interrupt.h"

#include <gtest/gtest.h>

namespace hpr {
namespace {

TEST(Interrupt, StaysRaised) {
  int polls = 0;
  Interrupt interrupt([&] { return ++polls == 1; });
  EXPECT_TRUE(interrupt.is_raised());
  EXPECT_TRUE(interrupt.is_raised());
  EXPECT_EQ(polls, 1);
}

TEST(Interrupt, PollsNowAndThen) {
  int polls = 0;
  Interrupt interrupt([&] {
    ++polls;
    return false;
  });
  const Stopwatch watch;
  for (int i = 0; i < 1000; ++i) EXPECT_FALSE(interrupt.is_raised());
  EXPECT_GE(polls, 1);
  EXPECT_LE(polls, 2 + static_cast<int>(watch.ms() / 5.0));
}

}  // namespace
}  // namespace hpr
