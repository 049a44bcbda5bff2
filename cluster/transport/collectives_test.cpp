#include "cluster/transport/collectives.h"

#include <gtest/gtest.h>

#include <atomic>
#include <numeric>
#include <string>
#include <vector>

#include "cluster/transport/local_communicator.h"
#include "cluster/transport/test_communicator.h"
#include "core/error.h"

namespace hpr {
namespace {

/// Of different lengths, that of rank 1 empty, those of others with a zero in them.
std::string text_of(int rank) {
  std::string text;
  for (int i = 1; i < rank; ++i) text += std::string("a\0b", 3);
  return rank == 0 ? "of rank 0" : text;
}

TEST(Collectives, BroadcastReachesAllRanksFromEveryRoot) {
  for (int size = 1; size <= 17; ++size) {
    run_local_ranks(size, [&](Communicator& comm) {
      for (int root = 0; root < size; ++root) {
        for (const std::size_t length : {0U, 1U, 1000U}) {
          std::vector<std::byte> bytes = comm.rank() == root ? test::message_of(root, length) : test::message_of(99, 5);
          broadcast(comm, bytes, root);
          EXPECT_EQ(bytes, test::message_of(root, length));
        }
      }
    });
  }
}

TEST(Collectives, GatherHoldsEveryRanksBytesInOrderOnEveryRoot) {
  for (int size = 1; size <= 17; ++size) {
    run_local_ranks(size, [&](Communicator& comm) {
      for (int root = 0; root < size; ++root) {
        const auto parts = gather(comm, test::message_of(comm.rank(), static_cast<std::size_t>(comm.rank())), root);
        if (comm.rank() != root) {
          EXPECT_TRUE(parts.empty());
          continue;
        }
        ASSERT_EQ(parts.size(), static_cast<std::size_t>(size));
        for (int rank = 0; rank < size; ++rank) {
          EXPECT_EQ(parts[static_cast<std::size_t>(rank)], test::message_of(rank, static_cast<std::size_t>(rank)));
        }
      }
    });
  }
}

TEST(Collectives, AllToAllBringsEveryPartToItsRank) {
  for (int size = 1; size <= 17; ++size) {
    run_local_ranks({.size = size, .disorder = 7}, [&](Communicator& comm) {
      // From rank 0 to rank 0 and wherever the product is 0 a part is empty: it must not vanish.
      const auto part = [size](int from, int to) {
        return test::message_of(from * size + to, static_cast<std::size_t>(from * to));
      };
      for (int round = 0; round < 2; ++round) {
        std::vector<std::vector<std::byte>> parts;
        for (int to = 0; to < size; ++to) parts.push_back(part(comm.rank(), to));
        const auto arrived = all_to_all(comm, std::move(parts));
        ASSERT_EQ(arrived.size(), static_cast<std::size_t>(size));
        for (int from = 0; from < size; ++from) {
          EXPECT_EQ(arrived[static_cast<std::size_t>(from)], part(from, comm.rank())) << from;
        }
      }
    });
  }
}

TEST(Collectives, AllGatherGivesEveryRankTheSame) {
  for (int size = 1; size <= 17; ++size) {
    run_local_ranks(size, [&](Communicator& comm) {
      // Rank 0 sends nothing: an empty part must not vanish.
      const auto parts = all_gather(comm, test::message_of(comm.rank(), static_cast<std::size_t>(comm.rank()) * 3));
      ASSERT_EQ(parts.size(), static_cast<std::size_t>(size));
      for (int rank = 0; rank < size; ++rank) {
        EXPECT_EQ(parts[static_cast<std::size_t>(rank)], test::message_of(rank, static_cast<std::size_t>(rank) * 3));
      }
      std::vector<double> expected(static_cast<std::size_t>(size));
      std::iota(expected.begin(), expected.end(), 0.5);
      EXPECT_EQ(all_gather_value(comm, comm.rank() + 0.5), expected);
    });
  }
}

TEST(Collectives, NobodyLeavesABarrierBeforeAllHaveCome) {
  for (int size = 1; size <= 17; ++size) {
    std::atomic<int> arrived = 0;
    run_local_ranks(size, [&](Communicator& comm) {
      for (int round = 1; round <= 5; ++round) {
        ++arrived;
        barrier(comm);
        EXPECT_GE(arrived, round * size);
        barrier(comm);
      }
    });
  }
}

TEST(Texts, OfRankZeroReachEveryRank) {
  run_local_ranks(5, [](Communicator& comm) { EXPECT_EQ(broadcast_text(comm, text_of(comm.rank())), "of rank 0"); });
  run_local_ranks(3, [](Communicator& comm) { EXPECT_EQ(broadcast_text(comm, ""), ""); });
}

TEST(Texts, OfEveryRankStandInTheirOrder) {
  run_local_ranks(5, [](Communicator& comm) {
    const std::vector<std::string> texts = all_gather_texts(comm, text_of(comm.rank()));
    ASSERT_EQ(texts.size(), 5U);
    for (int rank = 0; rank < 5; ++rank) EXPECT_EQ(texts[static_cast<std::size_t>(rank)], text_of(rank));
  });
}

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
