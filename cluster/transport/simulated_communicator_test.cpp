#include "cluster/transport/simulated_communicator.h"

#include <gtest/gtest.h>

#include <mutex>
#include <vector>

#include "cluster/transport/collectives.h"
#include "cluster/transport/local_communicator.h"
#include "cluster/transport/test_communicator.h"

namespace hpr {
namespace {

/// Two hosts of two ranks; whole numbers, so that sums can be done by hand.
const SimulatedCluster kCluster{.hosts = 2,
                                .ranks = 4,
                                .cores = 0,
                                .latency = 100.0,
                                .bandwidth = 10.0,
                                .overhead = 1.0,
                                .local_latency = 5.0,
                                .local_bandwidth = 50.0,
                                .merge = 25.0};

/// Each rank's clock after `body`.
std::vector<double> clocks(const SimulatedCluster& cluster, const std::function<void(Communicator&)>& body,
                           std::uint64_t disorder = 0) {
  std::vector<double> times(static_cast<std::size_t>(cluster.ranks));
  run_local_ranks({.size = cluster.ranks, .ranks_per_host = cluster.ranks_per_host(), .disorder = disorder},
                  [&](Communicator& local) {
                    SimulatedCommunicator comm(local, cluster);
                    body(comm);
                    times[static_cast<std::size_t>(comm.rank())] = comm.seconds();
                  });
  return times;
}

const std::vector<std::byte> kMessage(200);

TEST(SimulatedCommunicator, AMessageTakesOverheadTransferLatencyAndOverhead) {
  const auto between_hosts = clocks(kCluster, [](Communicator& comm) {
    if (comm.rank() == 0) comm.send(kMessage, 2);
    if (comm.rank() == 2) (void)comm.receive(0);
  });
  EXPECT_EQ(between_hosts, (std::vector<double>{1.0, 0.0, 1.0 + 20.0 + 100.0 + 1.0, 0.0}));
  const auto in_a_host = clocks(kCluster, [](Communicator& comm) {
    if (comm.rank() == 2) comm.send(kMessage, 3);
    if (comm.rank() == 3) (void)comm.receive(2);
  });
  EXPECT_EQ(in_a_host, (std::vector<double>{0.0, 0.0, 1.0, 1.0 + 4.0 + 5.0 + 1.0}));
}

TEST(SimulatedCommunicator, MessagesQueueAtTheSendersAndTheReceiversLink) {
  // Rank 0 sends twice: the second leaves when the first has.
  const auto sender = clocks(kCluster, [](Communicator& comm) {
    if (comm.rank() == 0) {
      comm.send(kMessage, 2);
      comm.send(kMessage, 3);
    }
    if (comm.rank() >= 2) (void)comm.receive(0);
  });
  EXPECT_EQ(sender[2], 122.0);
  EXPECT_EQ(sender[3], 1.0 + 20.0 + 20.0 + 100.0 + 1.0);
  // Ranks 0 and 1 send to rank 2 at once: the second is taken in after the first.
  const auto receiver = clocks(kCluster, [](Communicator& comm) {
    const Outgoing out{2, kMessage};
    if (comm.rank() < 2) comm.exchange({&out, 1}, {}, {});
    if (comm.rank() == 2) comm.exchange({}, std::vector<int>{0, 1}, [](int, auto) {});
  });
  EXPECT_EQ(receiver[2], 121.0 + 20.0 + 1.0);
}

TEST(SimulatedCommunicator, WorkTakesTimeAndSharedCoresMore) {
  EXPECT_EQ(clocks(kCluster, [](Communicator& comm) { comm.worked(50); })[1], 2.0);
  SimulatedCluster shared = kCluster;
  shared.cores = 1;
  EXPECT_EQ(clocks(shared, [](Communicator& comm) { comm.worked(50); })[1], 4.0);
}

TEST(SimulatedCommunicator, AMeetingBringsTheClocksOfAHostTogether) {
  const auto times = clocks(kCluster, [](Communicator& comm) {
    const auto memory = comm.share(8);
    if (comm.rank() == 1) comm.worked(2500);
    memory->mine()[7] = static_cast<std::byte>(comm.rank());
    memory->meet();
    EXPECT_EQ(memory->of(comm.rank() ^ 1)[7], static_cast<std::byte>(comm.rank() ^ 1));
    EXPECT_TRUE(memory->of(3 - comm.rank()).empty());
  });
  EXPECT_EQ(times, (std::vector<double>{110.0, 110.0, 10.0, 10.0}));
}

TEST(SimulatedCommunicator, TheOrderMessagesReallyComeInChangesNothing) {
  const auto body = [](Communicator& comm) {
    std::vector<std::vector<std::byte>> messages;
    std::vector<int> others;
    for (int peer = 0; peer < comm.size(); ++peer) {
      messages.emplace_back(static_cast<std::size_t>(10 + 7 * comm.rank() + 3 * peer));
      if (peer != comm.rank()) others.push_back(peer);
    }
    for (int round = 0; round < 5; ++round) {
      std::vector<Outgoing> out;
      for (const int peer : others) out.push_back({peer, messages[static_cast<std::size_t>(peer)]});
      comm.exchange(out, others, [&](int, auto message) { comm.worked(message.size()); });
    }
    const std::vector<int> pair{comm.rank() / 2 * 2, comm.rank() / 2 * 2 + 1};
    const auto part = comm.subset(pair);
    barrier(*part);
    barrier(comm);
  };
  const auto expected = clocks(kCluster, body);
  for (std::uint64_t disorder = 1; disorder < 20; ++disorder) EXPECT_EQ(clocks(kCluster, body, disorder), expected);
}

}  // namespace
}  // namespace hpr
