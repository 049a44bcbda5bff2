#include "cluster/transport/agreement.h"

#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <vector>

#include "cluster/transport/local_communicator.h"
#include "cluster/transport/test_failures.h"
#include "core/error.h"

namespace hpr {
namespace {

using test::expect_error_on_all;

TEST(OnRoot, RunsOnRankZeroAloneAndGivesAllItsBytes) {
  std::atomic<int> runs = 0;
  run_local_ranks(5, [&](Communicator& comm) {
    const auto bytes = on_root(comm, [&] {
      ++runs;
      return std::vector<std::byte>(3, std::byte{9});
    });
    EXPECT_EQ(bytes, std::vector<std::byte>(3, std::byte{9}));
    EXPECT_TRUE(on_root(comm, [] { return std::vector<std::byte>{}; }).empty());
  });
  EXPECT_EQ(runs, 1);
}

TEST(AgreeOnFailure, TheLowestFailingRankSpeaksForAll) {
  for (const int size : {3, 4, 9}) {
    expect_error_on_all(size, ExitCode::Limit, "rank 1 failed", [](Communicator& comm) {
      agree_on_failure(comm, [&] {
        if (comm.rank() == 1) throw Error(ExitCode::Limit, "rank 1 failed");
        if (comm.rank() == 2) throw Error(ExitCode::Io, "rank 2 failed");
      });
    });
  }
}

TEST(AgreeOnFailure, IsSilentWhenAllSucceed) {
  std::atomic<int> done = 0;
  run_local_ranks(6, [&](Communicator& comm) {
    agree_on_failure(comm, [&] { ++done; });
    EXPECT_EQ(done, 6);
  });
}

}  // namespace
}  // namespace hpr
