#include "core/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

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

}  // namespace
}  // namespace hpr
