#include "cluster/transport/schedule.h"

#include <gtest/gtest.h>

#include <array>

#include "cluster/transport/local_communicator.h"
#include "core/error.h"

namespace hpr {
namespace {

constexpr std::array<std::byte, 100> kBytes{};

Schedule record(const LocalRanks& ranks, const std::function<void(RecordingCommunicator&)>& body) {
  std::vector<std::vector<TraceEvent>> events(static_cast<std::size_t>(ranks.size));
  run_local_ranks(ranks, [&](Communicator& inner) {
    RecordingCommunicator comm(inner);
    body(comm);
    events[static_cast<std::size_t>(comm.rank())] = comm.take_events();
  });
  return schedule_of(events);
}

TEST(RecordingCommunicator, AMessageIsInTheFirstRoundBothItsRanksHaveGotTo) {
  // Rank 2 sends at once, but rank 0 takes it after what rank 1 sends.
  const Schedule schedule = record({.size = 3}, [](Communicator& comm) {
    if (comm.rank() == 0) {
      std::array<std::byte, 3> three{};
      comm.receive(three, 1);
      EXPECT_EQ(comm.receive(2).size(), 2U);
    } else {
      comm.send(std::span(kBytes).first(comm.rank() == 1 ? 3 : 2), 0);
    }
  });
  EXPECT_EQ(schedule.ranks, 3);
  EXPECT_EQ(schedule.rounds, 2);
  EXPECT_EQ(schedule.transfers, (std::vector<Transfer>{{0, 1, 0, 3, false}, {1, 2, 0, 2, false}}));
}

TEST(RecordingCommunicator, AnExchangeIsOneRoundAndItsSegmentsBelongToTheirMessage) {
  const Schedule schedule = record({.size = 4, .disorder = 3}, [](Communicator& comm) {
    for (const int distance : {1, 2}) {
      const int peer = comm.rank() ^ distance;
      const std::array<std::span<const std::byte>, 2> segments{std::span(kBytes).first(20),
                                                               std::span(kBytes).first(30)};
      const Outgoing out{peer, std::span(kBytes).first(8), segments};
      comm.exchange({&out, 1}, {&peer, 1}, [&](int from, std::span<const std::byte> /*message*/) {
        std::array<std::byte, 50> segment{};
        comm.receive(std::span(segment).first(20), from);
        comm.receive(std::span(segment).first(30), from);
        comm.worked(50);
      });
    }
  });
  EXPECT_EQ(schedule.rounds, 2);
  EXPECT_TRUE(schedule.works.empty());
  const std::vector<Transfer> expected{{0, 0, 1, 58, false}, {0, 1, 0, 58, false}, {0, 2, 3, 58, false},
                                       {0, 3, 2, 58, false}, {1, 0, 2, 58, false}, {1, 1, 3, 58, false},
                                       {1, 2, 0, 58, false}, {1, 3, 1, 58, false}};
  EXPECT_EQ(schedule.transfers, expected);
}

TEST(RecordingCommunicator, AnAnswerInsideAnExchangeComesARoundLater) {
  const Schedule schedule = record({.size = 2}, [](Communicator& comm) {
    if (comm.rank() == 0) {
      const int peer = 1;
      const Outgoing out{peer, std::span(kBytes).first(1)};
      comm.exchange({&out, 1}, {&peer, 1}, [](int /*from*/, std::span<const std::byte> /*message*/) {});
    } else {
      (void)comm.receive(0);
      comm.send(std::span(kBytes).first(2), 0);
    }
  });
  EXPECT_EQ(schedule.transfers, (std::vector<Transfer>{{0, 0, 1, 1, false}, {1, 1, 0, 2, false}}));
}

TEST(RecordingCommunicator, RanksOfASubsetAreNamedAsInTheWhole) {
  const Schedule schedule = record({.size = 5}, [](Communicator& comm) {
    if (comm.rank() % 2 == 1) return;
    const std::array<int, 3> even{0, 2, 4};
    const auto part = comm.subset(even);
    if (part->rank() == 2) part->send(kBytes, 1);
    if (part->rank() == 1) (void)part->receive(2);
  });
  EXPECT_EQ(schedule.transfers, (std::vector<Transfer>{{0, 4, 2, 100, false}}));
}

TEST(RecordingCommunicator, MeetingsAreOfAHostAndWorkBetweenThemIsAddedUp) {
  const Schedule schedule = record({.size = 4, .ranks_per_host = 2}, [](Communicator& comm) {
    const auto memory = comm.share(8);
    memory->meet();
    if (comm.rank() != 1) comm.worked(5);
    if (comm.rank() == 2) comm.worked(2);
    memory->meet();
  });
  EXPECT_EQ(schedule.rounds, 3);
  EXPECT_TRUE(schedule.transfers.empty());
  EXPECT_EQ(schedule.barriers, (std::vector<Barrier>{{0, {0, 1}}, {0, {2, 3}}, {2, {0, 1}}, {2, {2, 3}}}));
  EXPECT_EQ(schedule.works, (std::vector<InPlaceWork>{{1, {0, 1}, 5}, {1, {2, 3}, 12}}));
}

TEST(RecordingCommunicator, AReductionIsWhatEveryOtherRankGivesAway) {
  const Schedule schedule = record({.size = 3}, [](Communicator& comm) {
    std::array<std::uint64_t, 4> values{};
    comm.reduce_max(values, 1);
  });
  EXPECT_EQ(schedule.transfers, (std::vector<Transfer>{{0, 0, 1, 32, true}, {0, 2, 1, 32, true}}));
}

TEST(RecordingCommunicator, TakenEventsAreNotReturnedAgain) {
  run_local_ranks(2, [](Communicator& inner) {
    RecordingCommunicator comm(inner);
    const auto talk = [&] {
      if (comm.rank() == 0) {
        comm.send(kBytes, 1);
      } else {
        (void)comm.receive(0);
      }
    };
    talk();
    EXPECT_EQ(comm.take_events().size(), 1U);
    EXPECT_TRUE(comm.take_events().empty());
    talk();
    const auto events = comm.take_events();
    const auto& id = comm.rank() == 0 ? events.at(0).sent.at(0).id : events.at(0).received.at(0);
    EXPECT_EQ(id, (MessageId{{}, 0, 1, 1}));
  });
}

}  // namespace

}  // namespace hpr
