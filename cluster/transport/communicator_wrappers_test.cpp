#include "cluster/transport/communicator_wrappers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "cluster/transport/collectives.h"
#include "cluster/transport/local_communicator.h"
#include "cluster/transport/test_communicator.h"
#include "core/error.h"

namespace hpr {
namespace {

TEST(Counting, CountsWhatThisRankSendsAlsoThroughSubsets) {
  run_local_ranks(3, [](Communicator& comm) {
    CountingCommunicator counting(comm);
    EXPECT_EQ(counting.rank(), comm.rank());
    EXPECT_EQ(counting.size(), 3);
    const int next = (comm.rank() + 1) % 3;
    const int previous = (comm.rank() + 2) % 3;
    counting.send(test::message_of(0, 10), next);
    (void)counting.receive(previous);
    EXPECT_EQ(counting.messages_sent(), 1U);
    EXPECT_EQ(counting.bytes_sent(), 10U);

    std::vector<std::uint64_t> values(4);
    counting.reduce_max(values, 0);
    const std::size_t reduced = comm.rank() == 0 ? 0 : 1;
    EXPECT_EQ(counting.messages_sent(), 1 + reduced);
    EXPECT_EQ(counting.bytes_sent(), 10 + 32 * reduced);

    if (comm.rank() == 2) return;
    const auto part = counting.subset(std::vector<int>{0, 1});
    (void)test::exchange_with(*part, test::message_of(0, 7), 1 - part->rank());
    EXPECT_EQ(counting.messages_sent(), 2 + reduced);
    EXPECT_EQ(counting.bytes_sent(), 17 + 32 * reduced);
  });
}

TEST(RenumberedCommunicator, RanksAreReachedUnderTheirNewNumbers) {
  const std::vector<int> ranks{2, 0, 3, 1};
  run_local_ranks(4, [&](Communicator& plain) {
    RenumberedCommunicator comm(plain, ranks);
    EXPECT_EQ(comm.size(), 4);
    EXPECT_EQ(ranks[static_cast<std::size_t>(comm.rank())], plain.rank());
    EXPECT_EQ(all_gather_value(comm, plain.rank()), ranks);  // by send and receive, and exchanges

    const int next = (comm.rank() + 1) % 4;
    const int previous = (comm.rank() + 3) % 4;
    const std::vector<int> mine(25, comm.rank());
    const Outgoing out{next, std::as_bytes(std::span(mine))};
    comm.exchange({&out, 1}, {&previous, 1}, [&](int from, std::span<const std::byte> message) {
      EXPECT_EQ(from, previous);
      const std::vector<int> expected(25, previous);
      EXPECT_TRUE(std::ranges::equal(message, std::as_bytes(std::span(expected))));
    });

    std::uint64_t value = static_cast<std::uint64_t>(plain.rank()) + 5;
    comm.reduce_max({&value, 1}, 2);
    if (comm.rank() == 2) {
      EXPECT_EQ(value, 8U);
    }
  });
}

TEST(RenumberedCommunicator, SubsetsAndSharedMemoryKeepTheNewNumbers) {
  const std::vector<int> ranks{2, 0, 3, 1};
  run_local_ranks({.size = 4, .ranks_per_host = 2}, [&](Communicator& plain) {
    RenumberedCommunicator comm(plain, ranks);
    const auto memory = comm.share(8);
    memory->mine()[0] = static_cast<std::byte>(comm.rank() + 1);
    barrier(comm);
    for (int number = 0; number < 4; ++number) {
      const bool near = ranks[static_cast<std::size_t>(number)] / 2 == plain.rank() / 2;
      ASSERT_EQ(memory->of(number).empty(), !near);
      if (near) {
        EXPECT_EQ(memory->of(number)[0], static_cast<std::byte>(number + 1));
      }
    }
    barrier(comm);
    if (comm.rank() == 1) return;
    const auto part = comm.subset(std::vector<int>{0, 2, 3});
    EXPECT_EQ(all_gather_value(*part, comm.rank()), (std::vector<int>{0, 2, 3}));
  });
}

TEST(RenumberedCommunicator, RefusesListsThatDoNotHoldEveryRankOnce) {
  run_local_ranks(2, [](Communicator& plain) {
    for (const std::vector<int>& bad : std::vector<std::vector<int>>{{}, {0}, {0, 0}, {1, 2}, {0, 1, 2}}) {
      EXPECT_THROW(RenumberedCommunicator(plain, bad), Error);
    }
  });
}

}  // namespace

}  // namespace hpr
