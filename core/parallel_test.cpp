#include "core/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

#include "core/timing.h"

namespace hpr {
namespace {

TEST(ParallelFor, CallsEveryIndexExactlyOnce) {
  for (const int threads : {-1, 0, 1, 2, 3, 16}) {
    for (const std::size_t count : {0U, 1U, 2U, 17U, 1000U}) {
      std::vector<std::atomic<int>> calls(count);
      parallel_for(threads, count, [&](std::size_t i) { ++calls[i]; });
      for (const auto& made : calls) EXPECT_EQ(made, 1) << threads << " threads, " << count << " calls";
    }
  }
}

TEST(ParallelFor, UsesAtMostTheThreadsItWasGiven) {
  for (const int threads : {1, 2, 5}) {
    std::mutex mutex;
    std::set<std::thread::id> seen;
    parallel_for(threads, 200, [&](std::size_t) {
      const std::lock_guard lock(mutex);
      seen.insert(std::this_thread::get_id());
    });
    EXPECT_LE(seen.size(), static_cast<std::size_t>(threads));
  }
}

TEST(ParallelFor, OneThreadIsTheCallerInOrder) {
  std::vector<std::size_t> order;
  parallel_for(1, 5, [&](std::size_t i) { order.push_back(i); });
  EXPECT_EQ(order, (std::vector<std::size_t>{0, 1, 2, 3, 4}));
}

TEST(ParallelFor, RethrowsAnExceptionAfterAllThreadsStopped) {
  for (const int threads : {1, 2, 4}) {
    std::atomic<int> inside = 0;
    std::atomic<int> calls = 0;
    try {
      parallel_for(threads, 100000, [&](std::size_t i) {
        ++inside;
        ++calls;
        if (i == 3) {
          --inside;
          throw std::runtime_error("index 3");
        }
        --inside;
      });
      ADD_FAILURE() << "no exception came out";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "index 3");
    }
    EXPECT_EQ(inside, 0);
    EXPECT_LT(calls, 100000) << "the rest is not done after a failure";
  }
}

TEST(ParallelFor, KeepsItsThreadsFromLoopToLoop) {
  std::mutex mutex;
  std::set<std::thread::id> seen;
  std::jthread([&] {  // which has no threads from before
    for (int loop = 0; loop < 50; ++loop) {
      parallel_for(1 + loop % 4, 40, [&](std::size_t) {
        std::this_thread::sleep_for(std::chrono::microseconds(50));
        const std::lock_guard lock(mutex);
        seen.insert(std::this_thread::get_id());
      });
    }
  })
      .join();
  EXPECT_GT(seen.size(), 1U);
  EXPECT_LE(seen.size(), 4U);
}

TEST(ParallelFor, ServesManyCallersAtOnce) {
  std::atomic<std::size_t> calls = 0;
  {
    std::vector<std::jthread> callers;
    for (int i = 0; i < 6; ++i) {
      callers.emplace_back([&] {
        for (std::size_t loop = 0; loop < 300; ++loop) parallel_for(3, loop % 7, [&](std::size_t) { ++calls; });
      });
    }
  }
  std::size_t expected = 0;
  for (std::size_t loop = 0; loop < 300; ++loop) expected += 6 * (loop % 7);
  EXPECT_EQ(calls, expected);
}

/// A loop after one that failed starts anew.
TEST(ParallelFor, GoesOnAfterAFailure) {
  for (int loop = 0; loop < 20; ++loop) {
    EXPECT_THROW(parallel_for(3, 50,
                              [](std::size_t i) {
                                if (i % 10 == 7) throw std::runtime_error("a seven");
                              }),
                 std::runtime_error);
    std::atomic<int> calls = 0;
    parallel_for(3, 50, [&](std::size_t) { ++calls; });
    EXPECT_EQ(calls, 50);
  }
}

TEST(ParallelFor, RethrowsOneOfSeveralExceptions) {
  EXPECT_THROW(parallel_for(4, 100, [](std::size_t) { throw std::runtime_error("all of them"); }), std::runtime_error);
}

/// Uses so much processor time of this thread.
void spend(double ms) {
  const CpuStopwatch watch;
  while (watch.ms() < ms) {
  }
}

TEST(LoopProfile, TellsWhatOneThreadDoesAloneFromWhatLoopsShare) {
  LoopProfile profile;
  spend(20.0);
  parallel_for(2, 10, [](std::size_t i) { spend(i == 9 ? 22.0 : 2.0); });
  {
    const trace::Span span("alone");
    spend(10.0);
    parallel_for(1, 3, [](std::size_t) { spend(5.0); });  // of one thread: shared by nobody
    parallel_for(2, 1, [](std::size_t) { spend(5.0); });
    parallel_for(2, 2, [](std::size_t) {});
  }
  profile.finish();
  spend(10.0);
  parallel_for(2, 2, [](std::size_t) { spend(5.0); });
  // Nobody else's work is counted, but reading clocks is.
  EXPECT_NEAR(profile.serial_ms(), 50.0, 3.0);
  EXPECT_NEAR(profile.serial_phases().at("alone"), 30.0, 2.0);
  EXPECT_NEAR(profile.loops_ms(), 40.0, 3.0);
  EXPECT_LT(profile.others_ms(), 5.0);
  EXPECT_NEAR(profile.even_ms(1), profile.all_ms(), 1e-3);
  EXPECT_NEAR(profile.scheduled_ms(1), profile.all_ms(), 1e-3);
  EXPECT_NEAR(profile.even_ms(4), 50.0 + 10.0, 4.0);
  EXPECT_NEAR(profile.scheduled_ms(2), 50.0 + 30.0, 5.0) << "9 bodies by two, then one alone";
  EXPECT_NEAR(profile.scheduled_ms(100), 50.0 + 22.0, 5.0);
}

TEST(LoopProfile, IsOfTheThreadThatMadeItAndEndsWithIt) {
  LoopProfile profile;
  std::jthread([] {
    LoopProfile own;
    parallel_for(2, 4, [](std::size_t) { spend(2.0); });
    own.finish();
    EXPECT_GT(own.loops_ms(), 7.0);
  }).join();
  profile.finish();
  EXPECT_EQ(profile.loops_ms(), 0.0);
  EXPECT_THROW(parallel_for(2, 2, [](std::size_t) { throw std::runtime_error("after it"); }), std::runtime_error);
}

}  // namespace
}  // namespace hpr
