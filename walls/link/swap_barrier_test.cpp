#include "walls/link/swap_barrier.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "walls/link/connection.h"

namespace hpr {
namespace {

constexpr double kTimeout = 0.1;

/// Two displays: screens 0 and 1 on the first, screen 2 on the second.
SwapBarrier two_displays() {
  SwapBarrier barrier({0, 0, 1}, 2, kTimeout);
  barrier.connected(0, 0.0);
  barrier.connected(1, 0.0);
  return barrier;
}

void ready(SwapBarrier& barrier, std::initializer_list<std::size_t> screens, std::uint64_t frame, double now) {
  for (const std::size_t screen : screens) barrier.ready(screen, frame, now);
}

TEST(SwapBarrier, ShowsAFrameOnceEveryScreenIsReady) {
  SwapBarrier barrier = two_displays();
  barrier.post(0, 1.0);
  ready(barrier, {0, 2}, 0, 1.01);
  EXPECT_TRUE(barrier.due(1.02).empty());
  EXPECT_FALSE(barrier.all_ready(0));
  ready(barrier, {1}, 0, 1.03);
  EXPECT_TRUE(barrier.all_ready(0));
  const auto decisions = barrier.due(1.03);
  ASSERT_EQ(decisions.size(), 2U);
  for (const SwapDecision& decision : decisions) {
    EXPECT_EQ(decision.frame, 0U);
    EXPECT_FALSE(decision.late);
  }
  EXPECT_TRUE(barrier.due(5.0).empty()) << "each is returned once";
  barrier.shown(0, 0, 1.04);
  EXPECT_FALSE(barrier.all_shown(0));
  barrier.shown(1, 0, 1.05);
  EXPECT_TRUE(barrier.all_shown(0));
  const SwapOutcome outcome = barrier.outcome(0);
  EXPECT_EQ(outcome.screens, std::vector<ScreenState>(3, ScreenState::Fresh));
  ASSERT_TRUE(outcome.skew_s.has_value());
  EXPECT_NEAR(*outcome.skew_s, 0.01, 1e-12);
  EXPECT_EQ(barrier.degraded_seconds(5.0), 0.0);
}

TEST(SwapBarrier, AFrameThatWasOnlyOrderedDoesNotCountAsShown) {
  SwapBarrier barrier = two_displays();
  barrier.post(0, 1.0);
  ready(barrier, {0, 1, 2}, 0, 1.0);
  EXPECT_EQ(barrier.due(1.0).size(), 2U);
  barrier.shown(0, 0, 1.01);
  EXPECT_EQ(barrier.outcome(0).screens[2], ScreenState::Stale);
  barrier.gone(1, 1.02);
  EXPECT_EQ(barrier.outcome(0).screens[2], ScreenState::Lost);
  EXPECT_EQ(barrier.outcome(0).screens[0], ScreenState::Fresh);
}

TEST(SwapBarrier, WhoIsLateIsWaitedForOnceAndShowsTheFrameWhenItCan) {
  SwapBarrier barrier = two_displays();
  barrier.post(0, 1.0);
  ready(barrier, {0, 1}, 0, 1.0);
  EXPECT_TRUE(barrier.due(1.0 + kTimeout * 0.9).empty());
  ASSERT_TRUE(barrier.next_due().has_value());
  EXPECT_DOUBLE_EQ(*barrier.next_due(), 1.0 + kTimeout);
  ASSERT_EQ(barrier.due(1.0 + kTimeout).size(), 1U);

  barrier.post(1, 1.2);
  ready(barrier, {0, 1}, 1, 1.2);
  const auto next = barrier.due(1.2);
  ASSERT_EQ(next.size(), 1U) << "nobody waits for the one that fell behind";
  EXPECT_EQ(next[0].display, 0U);
  EXPECT_TRUE(barrier.all_ready(1));

  ready(barrier, {2}, 1, 1.3);
  const auto late = barrier.due(1.3);
  ASSERT_EQ(late.size(), 1U);
  EXPECT_EQ(late[0].display, 1U);
  EXPECT_EQ(late[0].frame, 1U);
  EXPECT_TRUE(late[0].late);
  EXPECT_EQ(barrier.outcome(1).screens[2], ScreenState::Stale);

  barrier.post(2, 1.4);
  ready(barrier, {0, 1}, 2, 1.4);
  EXPECT_TRUE(barrier.due(1.4).empty()) << "it has caught up, so it is waited for again";
  ready(barrier, {2}, 2, 1.41);
  EXPECT_EQ(barrier.due(1.41).size(), 2U);
  EXPECT_NEAR(barrier.degraded_seconds(9.0), 0.2, 1e-9) << "from 1.1 to 1.3";
}

TEST(SwapBarrier, ALostDisplayIsToldOnceAndBackOnce) {
  SwapBarrier barrier = two_displays();
  barrier.post(0, 1.0);
  ready(barrier, {0, 1, 2}, 0, 1.0);
  (void)barrier.due(1.0);
  barrier.gone(1, 1.5);
  barrier.gone(1, 1.6);
  auto events = barrier.take_events();
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].kind, SwapEvent::Kind::Lost);
  EXPECT_EQ(events[0].display, 1U);
  EXPECT_EQ(events[0].frame, 0U);

  barrier.post(1, 2.0);
  ready(barrier, {0, 1}, 1, 2.0);
  EXPECT_EQ(barrier.due(2.0).size(), 1U);
  barrier.shown(0, 1, 2.0);
  EXPECT_EQ(barrier.outcome(1).screens[2], ScreenState::Lost);
  EXPECT_FALSE(barrier.outcome(1).skew_s.has_value()) << "one display alone has no skew";

  barrier.connected(1, 2.5);
  EXPECT_TRUE(barrier.take_events().empty()) << "back is who shows the current frame";
  barrier.ready(2, 1, 2.6);
  EXPECT_EQ(barrier.due(2.6).size(), 1U);
  events = barrier.take_events();
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].kind, SwapEvent::Kind::Back);
  EXPECT_EQ(events[0].frame, 1U);
  EXPECT_NEAR(barrier.degraded_seconds(9.0), 1.1, 1e-9) << "from 1.5 to 2.6";
}

TEST(SwapBarrier, AWallWithoutDisplaysLosesEveryFrameAndHoldsNobodyUp) {
  SwapBarrier barrier({0, 1}, 2, kTimeout);
  barrier.post(0, 1.0);
  EXPECT_TRUE(barrier.all_ready(0));
  EXPECT_TRUE(barrier.due(9.0).empty());
  EXPECT_EQ(barrier.outcome(0).screens, std::vector<ScreenState>(2, ScreenState::Lost));
  EXPECT_EQ(barrier.take_events().size(), 2U);
  barrier.post(1, 2.0);
  EXPECT_TRUE(barrier.take_events().empty());
  EXPECT_NEAR(barrier.degraded_seconds(4.0), 3.0, 1e-9);
}

TEST(SwapBarrier, APictureThatNeverCameLeavesTheOthersTheirFrame) {
  SwapBarrier barrier = two_displays();
  barrier.post(0, 1.0);
  barrier.post(1, 1.01);
  ready(barrier, {0, 1}, 0, 1.0);
  ready(barrier, {2}, 1, 1.02);  // frame 0 was damaged: who has a later one will not have it any more
  const auto decisions = barrier.due(1.03);
  ASSERT_FALSE(decisions.empty());
  EXPECT_EQ(decisions[0].frame, 0U);
  EXPECT_EQ(decisions[0].display, 0U);
  for (const SwapDecision& decision : decisions) EXPECT_FALSE(decision.display == 1 && decision.frame == 0);
  EXPECT_EQ(barrier.outcome(0).screens[2], ScreenState::Stale);
}

TEST(SwapBarrier, WhoCannotShowIsToldOfOnceAndWaitedForNoLonger) {
  SwapBarrier barrier = two_displays();
  for (const std::uint64_t frame : {0U, 1U}) {
    const double now = 1.0 + static_cast<double>(frame);
    barrier.post(frame, now);
    ready(barrier, {0, 1, 2}, frame, now);
    ASSERT_EQ(barrier.due(now).size(), 2U);
    barrier.shown(0, frame, now);
    EXPECT_FALSE(barrier.all_shown(frame));
    barrier.not_shown(1, frame, now);
    EXPECT_TRUE(barrier.all_shown(frame));
    EXPECT_EQ(barrier.outcome(frame).screens[2], ScreenState::Stale);
  }
  barrier.shown(1, 1, 4.0);
  EXPECT_EQ(barrier.outcome(1).screens[2], ScreenState::Fresh);
  EXPECT_DOUBLE_EQ(barrier.degraded_seconds(9.0), 3.0);
  const auto events = barrier.take_events();
  ASSERT_EQ(events.size(), 2U);
  EXPECT_EQ(events[0].kind, SwapEvent::Kind::Failed);
  EXPECT_EQ(events[0].display, 1U);
  EXPECT_EQ(events[1].kind, SwapEvent::Kind::Back);
}

TEST(SwapBarrier, GivingUpMakesTheSlowOneLate) {
  SwapBarrier barrier = two_displays();
  barrier.post(0, 1.0);
  EXPECT_FALSE(barrier.all_ready(0));
  barrier.give_up(0, 1.1);
  EXPECT_TRUE(barrier.all_ready(0));
  (void)barrier.due(2.2);
  const auto events = barrier.take_events();
  ASSERT_EQ(events.size(), 2U) << "a second late is worth a line";
  EXPECT_EQ(events[0].kind, SwapEvent::Kind::Stale);
}

TEST(SwapBarrier, WhatIsForgottenChangesNothingForTheFramesThatCome) {
  for (const bool shows : {true, false}) {
    SwapBarrier barrier = two_displays();
    const auto frame = [&](std::uint64_t number) {
      const double now = static_cast<double>(number);
      barrier.post(number, now);
      if (!shows) return barrier.give_up(number, now);
      ready(barrier, {0, 1, 2}, number, now);
      ASSERT_EQ(barrier.due(now).size(), 2U);
      barrier.shown(0, number, now + 0.01);
      barrier.shown(1, number, now + 0.02);
    };
    for (std::uint64_t number = 0; number < 10; ++number) frame(number);
    const SwapOutcome kept = barrier.outcome(8);
    barrier.forget_before(8);
    EXPECT_THROW((void)barrier.outcome(6), std::out_of_range);
    EXPECT_EQ(barrier.outcome(8).screens, kept.screens);
    barrier.forget_before(1000);
    for (std::uint64_t number = 10; number < 13; ++number) frame(number);
    EXPECT_EQ(barrier.outcome(12).screens, kept.screens) << shows;
    EXPECT_TRUE(barrier.all_shown(12)) << "of those that keep up";
    // Told late of a frame nobody remembers.
    barrier.shown(0, 3, 14.0);
    barrier.ready(0, 3, 14.0);
    EXPECT_TRUE(barrier.due(14.0).empty());
  }
}

TEST(ClockOffset, FollowsTheQuickestRoundTrip) {
  ClockOffset offset;
  EXPECT_FALSE(offset.known());
  // The other clock is 100 s ahead. The answer of the first round trip took its time on the way back.
  offset.add(1.0, 101.001, 101.002, 1.5);
  offset.add(2.0, 102.001, 102.003, 2.004);
  EXPECT_NEAR(offset.seconds(), 100.0, 1e-9);
  EXPECT_NEAR(offset.round_trip(), 0.002, 1e-9);
  // Old ones are forgotten: clocks drift.
  for (int i = 0; i < 8; ++i) offset.add(10.0 + i, 110.5 + i, 110.5 + i, 10.01 + i);
  EXPECT_NEAR(offset.seconds(), 100.495, 1e-9);
}

}  // namespace
}  // namespace hpr
