#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <stdexcept>
#include <string>
#include <thread>

#include "cluster/transport/collectives.h"
#include "cluster/transport/local_communicator.h"
#include "cluster/transport/test_communicator.h"
#include "core/error.h"

namespace hpr {
namespace {

using Bytes = std::vector<std::byte>;
constexpr std::chrono::milliseconds kSoon{50};

Bytes letter(char c) {
  return Bytes{static_cast<std::byte>(c)};
}

TEST(LocalRanks, RunOnceEachAndKnowThemselves) {
  for (const int size : {1, 2, 5, 17}) {
    std::vector<std::atomic<int>> seen(static_cast<std::size_t>(size));
    run_local_ranks(size, [&](Communicator& comm) {
      EXPECT_EQ(comm.size(), size);
      EXPECT_EQ(comm.transport(), "threads");
      ++seen[static_cast<std::size_t>(comm.rank())];
    });
    for (const auto& count : seen) EXPECT_EQ(count, 1);
  }
}

TEST(LocalRanks, MessagesOfAnySizeArriveWholeAndInOrder) {
  run_local_ranks(3, [](Communicator& comm) {
    const int next = (comm.rank() + 1) % 3;
    const int previous = (comm.rank() + 2) % 3;
    for (const std::size_t size : {std::size_t{0}, std::size_t{1}, std::size_t{5'000'000}}) {
      comm.send(test::message_of(comm.rank(), size), next);
      comm.send(letter('z'), next);
      Bytes got(size);
      comm.receive(got, previous);
      EXPECT_EQ(got, test::message_of(previous, size));
      EXPECT_EQ(comm.receive(previous), letter('z'));
    }
  });
}

TEST(LocalRanks, ExchangeMayHaveTwoSizesAndAPeerMayBeOneself) {
  run_local_ranks(2, [](Communicator& comm) {
    const std::size_t mine = comm.rank() == 0 ? 0 : 1000;
    EXPECT_EQ(test::exchange_with(comm, test::message_of(comm.rank(), mine), 1 - comm.rank()),
              test::message_of(1 - comm.rank(), 1000 - mine));
    EXPECT_EQ(test::exchange_with(comm, letter('m'), comm.rank()), letter('m'));
  });
}

TEST(LocalRanks, AMessageOfAnotherSizeIsAnInternalError) {
  try {
    run_local_ranks(2, [](Communicator& comm) {
      if (comm.rank() == 0) {
        comm.send(test::message_of(0, 3), 1);
      } else {
        Bytes four(4);
        comm.receive(four, 0);
      }
    });
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Internal);
  }
}

/// What the error says that `receive` on rank 1 of two ends in, in frame 8, when rank 0 sends it something in frame 7.
template <typename Send, typename Receive>
std::string met_in_next_frame(Send send, Receive receive) {
  try {
    run_local_ranks(2, [&](Communicator& comm) {
      const std::vector<int> all{0, 1};
      const auto subset = comm.subset(all);
      comm.begin_frame(comm.rank() == 0 ? 7 : 8);
      if (comm.rank() == 0) {
        send(*subset);
      } else {
        receive(*subset);
      }
    });
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Internal);
    return error.what();
  }
  return "nothing";
}

TEST(LocalRanks, AMessageOfAnotherFrameIsAnErrorWithBothNumbers) {
  const std::string expected = "rank 1 is in frame 8 and met rank 0 in frame 7";
  const auto send = [](Communicator& comm) { comm.send(letter('a'), 1); };
  EXPECT_EQ(met_in_next_frame(send, [](Communicator& comm) { (void)comm.receive(0); }), expected);
  EXPECT_EQ(met_in_next_frame(send,
                              [](Communicator& comm) {
                                Bytes one(1);
                                comm.receive(one, 0);
                              }),
            expected);
  EXPECT_EQ(met_in_next_frame(send,
                              [](Communicator& comm) {
                                const int peer = 0;
                                comm.exchange({}, {&peer, 1}, [](int /*from*/, std::span<const std::byte> /*in*/) {});
                              }),
            expected);
  const auto reduce = [](Communicator& comm) {
    std::array<std::uint64_t, 1> values{1};
    comm.reduce_max(values, 1);
  };
  EXPECT_EQ(met_in_next_frame(reduce, reduce), expected);
}

TEST(LocalRanks, AMessageThatOvertookAnotherIsNamed) {
  const LocalRanks ranks{.size = 2, .hang_timeout = std::chrono::seconds(20), .overtaking = 0};
  for (const int messages : {1, 2, 3}) {
    std::string what;
    try {
      run_local_ranks(ranks, [&](Communicator& comm) {
        for (const std::uint64_t frame : {1U, 2U}) {
          comm.begin_frame(frame);
          for (int i = 0; i < messages; ++i) {
            if (comm.rank() == 0) {
              comm.send(letter('a'), 1);
            } else {
              (void)comm.receive(0);
            }
          }
        }
      });
    } catch (const Error& error) {
      what = error.what();
    }
    EXPECT_EQ(what, "rank 1 is in frame 1 and met rank 0 in frame 2");
  }
}

TEST(LocalRanks, ReduceMaxLeavesTheLargestOfEachOnTheRoot) {
  for (const int size : {1, 2, 3, 8, 17}) {
    for (int root = 0; root < size; ++root) {
      run_local_ranks(size, [&](Communicator& comm) {
        std::vector<std::uint64_t> values(100);
        for (std::size_t i = 0; i < values.size(); ++i) {
          // Rank i % size holds the largest; the top bit says that the comparison is unsigned.
          values[i] = static_cast<int>(i) % size == comm.rank() ? ~std::uint64_t{0} - i
                                                                : static_cast<std::uint64_t>(comm.rank());
        }
        comm.reduce_max(values, root);
        if (comm.rank() != root) return;
        for (std::size_t i = 0; i < values.size(); ++i) ASSERT_EQ(values[i], ~std::uint64_t{0} - i);
      });
    }
  }
}

TEST(LocalRanks, AReductionDoesNotTakeAMessageSentBefore) {
  run_local_ranks(2, [](Communicator& comm) {
    std::vector<std::uint64_t> values{static_cast<std::uint64_t>(comm.rank()) + 5};
    if (comm.rank() == 1) comm.send(test::message_of(1, 8), 0);
    comm.reduce_max(values, 0);
    if (comm.rank() == 0) {
      EXPECT_EQ(values[0], 6U);
      EXPECT_EQ(comm.receive(1), test::message_of(1, 8));
    }
  });
}

TEST(LocalRanks, ASubsetNumbersItsMembersInOrder) {
  run_local_ranks(5, [](Communicator& comm) {
    const std::vector<int> members = comm.rank() % 2 == 0 ? std::vector<int>{0, 2, 4} : std::vector<int>{1, 3};
    const auto part = comm.subset(members);
    EXPECT_EQ(part->size(), static_cast<int>(members.size()));
    EXPECT_EQ(members[static_cast<std::size_t>(part->rank())], comm.rank());
    const auto ranks = all_gather_value(*part, comm.rank());
    EXPECT_EQ(ranks, members);
  });
}

TEST(LocalRanks, MessagesOfASubsetMeetNoOthers) {
  run_local_ranks(3, [](Communicator& comm) {
    // The same members as the world, twice, and a subset of one of them: four communicators between ranks 0 and 1.
    const std::vector<int> all{0, 1, 2};
    const auto first = comm.subset(all);
    const auto second = comm.subset(all);
    if (comm.rank() == 2) return;
    const auto pair = second->subset(std::vector<int>{0, 1});
    if (comm.rank() == 0) {
      comm.send(letter('w'), 1);
      first->send(letter('1'), 1);
      second->send(letter('2'), 1);
      pair->send(letter('p'), 1);
    } else {
      EXPECT_EQ(pair->receive(0), letter('p'));
      EXPECT_EQ(second->receive(0), letter('2'));
      EXPECT_EQ(first->receive(0), letter('1'));
      EXPECT_EQ(comm.receive(0), letter('w'));
    }
  });
}

TEST(LocalRanks, SubsetsNeedNoCallFromOtherRanks) {
  run_local_ranks(3, [](Communicator& comm) {
    // Rank 0 makes two, the others one each: their counts must not have to agree.
    if (comm.rank() != 2) {
      EXPECT_EQ(all_gather_value(*comm.subset(std::vector<int>{0, 1}), 7).size(), 2U);
    }
    if (comm.rank() != 1) {
      EXPECT_EQ(all_gather_value(*comm.subset(std::vector<int>{0, 2}), 7).size(), 2U);
    }
  });
}

TEST(LocalRanks, AWaitEndsAtTheTimeLimitAndNamesTheRank) {
  try {
    run_local_ranks(
        3,
        [](Communicator& comm) {
          if (comm.rank() == 1) (void)comm.receive(2);
        },
        kSoon);
    FAIL() << "nobody sent anything";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Hang);
    EXPECT_NE(std::string(error.what()).find("rank 1"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("rank 2"), std::string::npos);
  }
}

TEST(LocalRanks, TheLongestTimeLimitIsNotTakenForAPassedOne) {
  run_local_ranks(
      2,
      [](Communicator& comm) {
        if (comm.rank() == 0) std::this_thread::sleep_for(kSoon);
        barrier(comm);
      },
      std::chrono::nanoseconds::max());
}

TEST(LocalRanks, WhenOneFailsItsPeersAreLostAndTheFirstFailureComesOut) {
  std::atomic<int> lost = 0;
  try {
    run_local_ranks(5, [&](Communicator& comm) {
      if (comm.rank() == 3) {
        std::this_thread::sleep_for(kSoon);
        throw std::runtime_error("rank 3 broke");
      }
      try {
        (void)comm.receive(3);
      } catch (const Error& error) {
        if (error.code() == ExitCode::Lost) ++lost;
        throw;
      }
    });
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "rank 3 broke");
  }
  EXPECT_EQ(lost, 4);
}

TEST(LocalRanks, AFailureOfRankZeroComesOutToo) {
  EXPECT_THROW(run_local_ranks(3,
                               [](Communicator& comm) {
                                 if (comm.rank() == 0) throw std::invalid_argument("rank 0 broke");
                                 barrier(comm);
                               }),
               std::invalid_argument);
}

TEST(LocalRanksDeathTest, APeerThatDoesNotExistBreaksTheContract) {
  EXPECT_DEATH(run_local_ranks(1, [](Communicator& comm) { comm.send({}, 1); }), "broken contract");
  EXPECT_DEATH(run_local_ranks(1, [](Communicator& comm) { (void)comm.receive(-1); }), "broken contract");
}

TEST(LocalRanks, AnExchangeOfManyReceivesEachMessageWithItsSegments) {
  for (const std::uint64_t disorder : {0U, 1U, 2U}) {
    run_local_ranks({.size = 5, .disorder = disorder}, [](Communicator& comm) {
      for (int round = 0; round < 20; ++round) {
        std::vector<std::vector<std::byte>> heads;
        std::vector<std::vector<std::byte>> parts;
        std::vector<Outgoing> out;
        std::vector<int> from;
        for (int peer = 0; peer < comm.size(); ++peer) {
          heads.push_back(test::message_of(comm.rank() + round, 3 + static_cast<std::size_t>(peer)));
          parts.push_back(test::message_of(comm.rank() + 7, 100));
          if (peer != comm.rank()) from.push_back(peer);
        }
        const std::array<std::span<const std::byte>, 2> segments{parts[0], parts[1]};
        for (const int peer : from) out.push_back({peer, heads[static_cast<std::size_t>(peer)], segments});
        std::vector<int> came;
        comm.exchange(out, from, [&](int peer, std::span<const std::byte> message) {
          came.push_back(peer);
          EXPECT_TRUE(
              std::ranges::equal(message, test::message_of(peer + round, 3 + static_cast<std::size_t>(comm.rank()))));
          for (int segment = 0; segment < 2; ++segment) EXPECT_EQ(comm.receive(peer), test::message_of(peer + 7, 100));
        });
        std::ranges::sort(came);
        EXPECT_EQ(came, from);
      }
    });
  }
}

TEST(LocalRanks, RanksOfAHostSeeEachOthersMemoryAndMeet) {
  run_local_ranks({.size = 5, .ranks_per_host = 2}, [](Communicator& comm) {
    const auto memory = comm.share(3);
    EXPECT_EQ(memory->mine().size(), 3U);
    for (int frame = 0; frame < 50; ++frame) {
      memory->mine()[1] = static_cast<std::byte>(comm.rank() + frame);
      memory->meet();
      for (int peer = 0; peer < comm.size(); ++peer) {
        const bool here = peer / 2 == comm.rank() / 2;
        EXPECT_EQ(memory->of(peer).size(), here ? 3U : 0U);
        if (here) {
          EXPECT_EQ(memory->of(peer)[1], static_cast<std::byte>(peer + frame));
        }
      }
      memory->meet();
    }
  });
}

TEST(LocalRanks, ARankThatDoesNotComeToAMeetingIsAHangAndOneThatFailsIsLost) {
  for (const bool fails : {false, true}) {
    try {
      run_local_ranks({.size = 2, .hang_timeout = std::chrono::milliseconds(fails ? 60'000 : 100)},
                      [&](Communicator& comm) {
                        const auto memory = comm.share(8);
                        if (comm.rank() == 0) {
                          memory->meet();
                        } else if (fails) {
                          throw Error(ExitCode::Io, "gone");
                        } else {
                          std::this_thread::sleep_for(std::chrono::milliseconds(400));
                        }
                      });
      FAIL() << "expected an Error";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), fails ? ExitCode::Io : ExitCode::Hang);
    }
  }
}

}  // namespace
}  // namespace hpr
