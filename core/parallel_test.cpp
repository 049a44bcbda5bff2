#include "core/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
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

TEST(ParallelFor, RethrowsOneOfSeveralExceptions) {
  EXPECT_THROW(parallel_for(4, 100, [](std::size_t) { throw std::runtime_error("all of them"); }), std::runtime_error);
}

}  // namespace
}  // namespace hpr
