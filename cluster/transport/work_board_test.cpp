#include "cluster/transport/work_board.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstring>
#include <vector>

#include "cluster/transport/collectives.h"
#include "cluster/transport/local_communicator.h"
#include "core/error.h"
#include "core/parallel.h"

namespace hpr {
namespace {

using namespace std::chrono_literals;

constexpr auto kLimit = 60s;

TEST(WorkBoard, EachPieceIsDrawnOnceWhoeverDrawsIt) {
  constexpr int kRounds = 20;
  for (const int ranks : {1, 2, 3, 5, 8}) {
    // Per round, owner and piece how often it was drawn.
    std::vector<std::atomic<int>> drawn(static_cast<std::size_t>(kRounds * ranks * 100));
    run_local_ranks(
        ranks,
        [&](Communicator& comm) {
          WorkBoard board(comm, 8);
          for (int round = 0; round < kRounds; ++round) {
            board.next_round(comm);
            EXPECT_EQ(board.remaining(comm.rank()), 0U);
            const std::uint64_t mine = static_cast<std::uint64_t>((comm.rank() + round) % 3) * 40;
            const std::uint64_t word = mine + 1000 * static_cast<std::uint64_t>(round);
            std::memcpy(board.payload().data(), &word, sizeof(word));
            board.publish(mine);
            parallel_for(2, 2, [&](std::size_t) {
              bool all = false;
              while (!all) {
                all = true;
                for (int rank = 0; rank < ranks; ++rank) {
                  all = all && board.is_published(rank);
                  while (const auto piece = board.draw(rank)) {
                    std::uint64_t read = 0;
                    std::memcpy(&read, board.payload_of(rank).data(), sizeof(read));
                    EXPECT_EQ(read, static_cast<std::uint64_t>((rank + round) % 3) * 40 +
                                        1000U * static_cast<unsigned>(round));
                    EXPECT_LT(*piece, read - 1000U * static_cast<unsigned>(round));
                    ++drawn[(static_cast<std::size_t>(round) * static_cast<std::size_t>(ranks) +
                             static_cast<std::size_t>(rank)) *
                                100 +
                            *piece];
                  }
                }
              }
            });
          }
        },
        kLimit);
    for (int round = 0; round < kRounds; ++round) {
      for (int rank = 0; rank < ranks; ++rank) {
        for (int piece = 0; piece < 100; ++piece) {
          const int expected = piece < (rank + round) % 3 * 40 ? 1 : 0;
          EXPECT_EQ(drawn[static_cast<std::size_t>((round * ranks + rank) * 100 + piece)], expected);
        }
      }
    }
  }
}

TEST(WorkBoard, RanksOfAnotherHostAreNotSeen) {
  run_local_ranks({.size = 3, .hang_timeout = kLimit, .ranks_per_host = 2}, [](Communicator& comm) {
    WorkBoard board(comm, 8);
    board.next_round(comm);
    EXPECT_EQ(board.sees(0), comm.rank() < 2);
    EXPECT_EQ(board.sees(2), comm.rank() == 2);
    EXPECT_GE(board.bytes(), 8U);
    board.raise();
    EXPECT_TRUE(board.is_raised());
  });
}

TEST(WorkBoard, ARoundThatIsToEndEndsForAllAndTheNextOneDoesNot) {
  run_local_ranks(
      3,
      [](Communicator& comm) {
        WorkBoard board(comm, 0);
        board.next_round(comm);
        EXPECT_FALSE(board.is_raised());
        barrier(comm);
        if (comm.rank() == 1) board.raise();
        barrier(comm);
        EXPECT_TRUE(board.is_raised());
        board.next_round(comm);
        EXPECT_FALSE(board.is_raised());
      },
      kLimit);
}

TEST(WorkBoard, RanksAgreeOnTheRoundAfterOneOfThemMissedSome) {
  run_local_ranks(
      2,
      [](Communicator& comm) {
        WorkBoard board(comm, 0);
        board.next_round(comm);
        board.publish(1);
        barrier(comm);
        EXPECT_TRUE(board.is_published(0) && board.is_published(1));
        board.next_round(comm);
        EXPECT_FALSE(board.is_published(comm.rank()));
        EXPECT_EQ(board.draw(comm.rank()), std::nullopt);
        board.publish(1);
        EXPECT_EQ(board.remaining(comm.rank()), 1U);
        barrier(comm);
        EXPECT_TRUE(board.is_published(1 - comm.rank()));
      },
      kLimit);
}

}  // namespace
}  // namespace hpr
