// The contract of Communicator, by MPI: run by mpiexec with 1 to 5 ranks. Each rank checks its own part; EXPECT, never
// ASSERT, between collective calls, so that one failing rank leaves no other waiting.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <mpi.h>
#include <sched.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <limits>
#include <memory>
#include <numeric>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "cluster/distribution/scene_distribution.h"
#include "cluster/transport/collectives.h"
#include "cluster/transport/host_memory.h"
#include "cluster/transport/mpi_communicator.h"
#include "cluster/transport/test_communicator.h"
#include "cluster/transport/work_board.h"
#include "core/error.h"
#include "core/timing.h"

namespace hpr {
namespace {

using Bytes = std::vector<std::byte>;
constexpr std::size_t kSmallPart = 1024;

TEST(Mpi, MessagesOfOddSizesGoRoundTheRing) {
  MpiCommunicator comm(MPI_COMM_WORLD);
  const int next = (comm.rank() + 1) % comm.size();
  const int previous = (comm.rank() + comm.size() - 1) % comm.size();
  for (const std::size_t size : {std::size_t{0}, std::size_t{1}, std::size_t{4097}, std::size_t{3'000'001}}) {
    // Ranks take turns: a large send ends only when it is received.
    if (comm.size() == 1) {
      EXPECT_EQ(test::exchange_with(comm, test::message_of(0, size), 0), test::message_of(0, size));
      continue;
    }
    for (int sender = 0; sender < comm.size(); ++sender) {
      if (comm.rank() == sender) comm.send(test::message_of(sender, size), next);
      if (previous == sender) {
        EXPECT_TRUE(comm.receive(sender) == test::message_of(sender, size));
      }
    }
    for (int sender = 0; sender < comm.size(); ++sender) {
      if (comm.rank() == sender) comm.send(test::message_of(sender, size), next);
      if (previous == sender) {
        Bytes known(size);
        comm.receive(known, sender);
        EXPECT_TRUE(known == test::message_of(sender, size));
      }
    }
  }
}

TEST(Mpi, MessagesInPartsArriveWholeAndInOrder) {
  MpiCommunicator comm(MPI_COMM_WORLD, kHangTimeout, kSmallPart);
  const int peer = comm.rank() ^ 1;
  if (peer >= comm.size()) return;
  for (const std::size_t size : {kSmallPart - 1, kSmallPart, kSmallPart + 1, 2 * kSmallPart, 10 * kSmallPart + 3}) {
    EXPECT_TRUE(test::exchange_with(comm, test::message_of(comm.rank(), size), peer) == test::message_of(peer, size))
        << size;
    if (comm.rank() < peer) {
      comm.send(test::message_of(1, size), peer);
      comm.send(test::message_of(2, 5), peer);
    } else {
      Bytes known(size);
      comm.receive(known, peer);
      EXPECT_TRUE(known == test::message_of(1, size)) << size;
      EXPECT_TRUE(comm.receive(peer) == test::message_of(2, 5));
    }
  }
}

TEST(Mpi, ExchangeMayHaveTwoSizes) {
  MpiCommunicator comm(MPI_COMM_WORLD);
  for (int peer = 0; peer < comm.size(); ++peer) {
    for (int other = 0; other < peer; ++other) {
      if (comm.rank() != peer && comm.rank() != other) continue;
      const int partner = comm.rank() == peer ? other : peer;
      const auto size_of = [](int rank) { return static_cast<std::size_t>(rank) * 700'001; };
      EXPECT_TRUE(test::exchange_with(comm, test::message_of(comm.rank(), size_of(comm.rank())), partner) ==
                  test::message_of(partner, size_of(partner)));
    }
  }
}

/// This thread runs on one core alone while it lives, that of rank 0.
class OnOneCore {
 public:
  OnOneCore() {
    sched_getaffinity(0, sizeof(cpu_set_t), &before_);
    unsigned core = 0;
    while (core + 1 < CPU_SETSIZE && CPU_ISSET(core, &before_) == 0) ++core;
    MPI_Bcast(&core, 1, MPI_UNSIGNED, 0, MPI_COMM_WORLD);
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(core, &one);
    works_ = sched_setaffinity(0, sizeof(cpu_set_t), &one) == 0;
  }
  ~OnOneCore() { sched_setaffinity(0, sizeof(cpu_set_t), &before_); }
  OnOneCore(const OnOneCore&) = delete;
  OnOneCore& operator=(const OnOneCore&) = delete;

  [[nodiscard]] bool works() const { return works_; }

 private:
  cpu_set_t before_{};
  bool works_ = false;
};

/// How often this thread has gone to sleep.
long count_sleeps() {
  rusage usage{};
  ::getrusage(RUSAGE_THREAD, &usage);
  return usage.ru_nvcsw;
}

TEST(Mpi, RanksThatShareACoreSleepWhileTheyWait) {
  const OnOneCore affinity;
  MpiCommunicator comm(MPI_COMM_WORLD);
  if (comm.size() == 1) return;
  constexpr std::chrono::milliseconds kWait{400};
  constexpr std::chrono::milliseconds kMaxLate{4000};  // on a machine that is busy with other work
  for (const bool in_subset : {false, true}) {
    std::vector<int> all(static_cast<std::size_t>(comm.size()));
    std::iota(all.begin(), all.end(), 0);
    const std::unique_ptr<Communicator> subset = in_subset ? comm.subset(all) : nullptr;
    Communicator& used = in_subset ? *subset : comm;
    barrier(used);
    const CpuStopwatch cpu;
    const Stopwatch watch;
    const long before = count_sleeps();
    std::uint64_t value = 7;
    if (used.rank() == 0) {
      std::this_thread::sleep_for(kWait);
      for (int rank = 1; rank < used.size(); ++rank) used.send(std::as_bytes(std::span(&value, 1)), rank);
      continue;
    }
    used.receive(std::as_writable_bytes(std::span(&value, 1)), 0);
    EXPECT_LT(watch.ms(), static_cast<double>((kWait + kMaxLate).count()));  // messages still come soon
    if (affinity.works()) {
      EXPECT_LT(cpu.ms(), static_cast<double>(kWait.count()) / 2.0);
      EXPECT_GT(count_sleeps() - before, 20);
    }
  }
}

TEST(Mpi, ReduceMaxLeavesTheLargestOfEachOnEveryRoot) {
  for (const std::size_t part : {kSmallPart, MpiCommunicator::kMaxPartBytes}) {
    MpiCommunicator comm(MPI_COMM_WORLD, kHangTimeout, part);
    for (int root = 0; root < comm.size(); ++root) {
      std::vector<std::uint64_t> values(1001);
      for (std::size_t i = 0; i < values.size(); ++i) {
        values[i] =
            static_cast<int>(i) % comm.size() == comm.rank() ? std::numeric_limits<std::uint64_t>::max() - i : i;
      }
      comm.reduce_max(values, root);
      if (comm.rank() != root) continue;
      bool right = true;
      for (std::size_t i = 0; i < values.size(); ++i) {
        right = right && values[i] == std::numeric_limits<std::uint64_t>::max() - i;
      }
      EXPECT_TRUE(right) << "root " << root << ", parts of " << part;
    }
    comm.reduce_max({}, 0);
  }
}

TEST(Mpi, SubsetsNumberTheirMembersAndKeepTheirMessagesApart) {
  MpiCommunicator comm(MPI_COMM_WORLD, kHangTimeout, kSmallPart);
  std::vector<int> members;
  for (int rank = comm.rank() % 2; rank < comm.size(); rank += 2) members.push_back(rank);
  const auto first = comm.subset(members);
  const auto second = comm.subset(members);
  EXPECT_EQ(first->size(), static_cast<int>(members.size()));
  EXPECT_EQ(members[static_cast<std::size_t>(first->rank())], comm.rank());
  EXPECT_EQ(all_gather_value(*first, comm.rank()), members);
  if (first->size() > 1 && first->rank() == 0) {
    first->send(test::message_of(1, 3000), 1);
    second->send(test::message_of(2, 10), 1);
    comm.send(test::message_of(3, 10), members[1]);
  } else if (first->rank() == 1) {
    // A large message may wait for its receiver, so the first one is taken first; the small ones in the other order.
    EXPECT_TRUE(first->receive(0) == test::message_of(1, 3000));
    EXPECT_TRUE(comm.receive(members[0]) == test::message_of(3, 10));
    EXPECT_TRUE(second->receive(0) == test::message_of(2, 10));
  }
}

TEST(Mpi, CollectivesWorkFromEveryRoot) {
  MpiCommunicator comm(MPI_COMM_WORLD);
  for (int root = 0; root < comm.size(); ++root) {
    Bytes bytes = comm.rank() == root ? test::message_of(root, 100'003) : Bytes{};
    broadcast(comm, bytes, root);
    EXPECT_TRUE(bytes == test::message_of(root, 100'003));
    const auto parts =
        gather(comm, test::message_of(comm.rank(), static_cast<std::size_t>(comm.rank()) * 50'000), root);
    if (comm.rank() == root) {
      for (int rank = 0; rank < comm.size(); ++rank) {
        EXPECT_TRUE(parts[static_cast<std::size_t>(rank)] ==
                    test::message_of(rank, static_cast<std::size_t>(rank) * 50'000));
      }
    }
    barrier(comm);
  }
  std::vector<int> ranks;
  for (int rank = 0; rank < comm.size(); ++rank) ranks.push_back(rank);
  EXPECT_EQ(all_gather_value(comm, comm.rank()), ranks);
}

TEST(Mpi, RanksOfAHostDrawEachPieceOfWorkOnce) {
  constexpr std::uint64_t kPieces = 200;
  MpiCommunicator comm(MPI_COMM_WORLD);
  WorkBoard board(comm, 16);
  for (std::uint64_t round = 0; round < 50; ++round) {
    board.next_round(comm);
    board.payload()[0] = static_cast<std::byte>(10 * round + static_cast<std::uint64_t>(comm.rank()));
    board.publish(kPieces + static_cast<std::uint64_t>(comm.rank()));
    std::vector<std::uint64_t> drawn;  // of all lists
    for (bool is_open = true; is_open;) {
      is_open = false;
      for (int rank = 0; rank < comm.size(); ++rank) {
        ASSERT_TRUE(board.sees(rank));
        if (const auto piece = board.draw(rank)) {
          EXPECT_EQ(board.payload_of(rank)[0], static_cast<std::byte>(10 * round + static_cast<std::uint64_t>(rank)));
          drawn.push_back(1000 * static_cast<std::uint64_t>(rank) + *piece);
          is_open = true;
        }
        is_open = is_open || !board.is_published(rank);
      }
    }
    std::vector<std::uint64_t> all;
    for (const auto& list : all_gather_lists(comm, std::span<const std::uint64_t>(drawn))) {
      all.insert(all.end(), list.begin(), list.end());
    }
    std::ranges::sort(all);
    std::vector<std::uint64_t> expected;
    for (std::uint64_t rank = 0; rank < static_cast<std::uint64_t>(comm.size()); ++rank) {
      for (std::uint64_t piece = 0; piece < kPieces + rank; ++piece) expected.push_back(1000 * rank + piece);
    }
    EXPECT_EQ(all, expected) << "round " << round;
  }
}

TEST(Mpi, RanksOfAHostShareOneBlock) {
  MpiCommunicator comm(MPI_COMM_WORLD);
  for (int again = 0; again < 3; ++again) {
    HostMemory memory(comm, 100'000);
    EXPECT_EQ(memory.ranks(), comm.size());
    EXPECT_EQ(memory.is_first(), comm.rank() == 0);
    for (std::size_t round = 1; round <= 200; ++round) {
      memory.bytes()[round * 400 + static_cast<std::size_t>(comm.rank())] = static_cast<std::byte>(round);
      memory.meet();
      for (std::size_t rank = 0; rank < static_cast<std::size_t>(comm.size()); ++rank) {
        ASSERT_EQ(memory.bytes()[round * 400 + rank], static_cast<std::byte>(round)) << rank;
      }
    }
    memory.meet();
    if (memory.is_first()) HostMemory::release(memory.bytes());
    memory.meet();
    const std::span<const std::byte> whole_pages = memory.bytes().first(16 * 4096);
    EXPECT_EQ(std::ranges::count(whole_pages, std::byte{0}), std::ssize(whole_pages));
  }
}

TEST(Mpi, AnErrorOfRankZeroReachesEveryone) {
  MpiCommunicator comm(MPI_COMM_WORLD);
  ExitCode code = ExitCode::Done;
  try {
    (void)distribute_scene(comm, []() -> Scene { throw Error(ExitCode::BadInput, "index out of range"); });
  } catch (const Error& error) {
    code = error.code();
  }
  EXPECT_EQ(code, ExitCode::BadInput);
}

TEST(Mpi, AMessageOfAnotherSizeIsAnInternalError) {
  MpiCommunicator comm(MPI_COMM_WORLD);
  if (comm.rank() > 1 || comm.size() == 1) return;
  if (comm.rank() == 0) {
    comm.send(test::message_of(0, 3), 1);
    return;
  }
  Bytes two(2);
  ExitCode code = ExitCode::Done;
  try {
    comm.receive(two, 0);
  } catch (const Error& error) {
    code = error.code();
  }
  EXPECT_EQ(code, ExitCode::Internal);
}

/// What the error says that `receive` on rank 1 ends in when rank 0, in frame `sent_in`, sends it a message there.
template <typename Receive>
std::string met_in_frame(std::uint64_t frame, std::uint64_t sent_in, Receive receive) {
  MpiCommunicator comm(MPI_COMM_WORLD);
  if (comm.rank() > 1) return {};
  const std::vector<int> pair{0, 1};
  const auto both = comm.subset(pair);
  if (comm.rank() == 0) {
    comm.begin_frame(sent_in);
    both->send(test::message_of(0, 3), 1);
    return {};
  }
  comm.begin_frame(frame);
  try {
    receive(*both);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Internal);
    return error.what();
  }
  return "nothing";
}

TEST(Mpi, AMessageOfAnotherFrameIsAnErrorWithBothNumbers) {
  if (MpiCommunicator(MPI_COMM_WORLD).size() == 1) return;
  const auto whole = [](Communicator& comm) { (void)comm.receive(0); };
  const auto known = [](Communicator& comm) {
    Bytes three(3);
    comm.receive(three, 0);
  };
  const auto exchanged = [](Communicator& comm) {
    const int peer = 0;
    comm.exchange({}, {&peer, 1}, [](int /*from*/, std::span<const std::byte> /*message*/) {});
  };
  const bool meets = MpiCommunicator(MPI_COMM_WORLD).rank() == 1;
  const auto expected = [meets](std::string_view frames) {
    return meets ? fmt::format(fmt::runtime(frames), "rank 1 is in frame", "and met rank 0 in frame") : std::string();
  };
  EXPECT_EQ(met_in_frame(8, 7, whole), expected("{} 8 {} 7"));
  EXPECT_EQ(met_in_frame(7, 8, known), expected("{} 7 {} 8"));
  EXPECT_EQ(met_in_frame(0, 3, exchanged), expected("{} 0 {} 3"));
  const std::uint64_t late = std::uint64_t{1} << 40U;  // past MPI's tags
  EXPECT_EQ(met_in_frame(late, late - 2, whole), expected("{} 1099511627776 {} 1099511627774"));
  EXPECT_EQ(met_in_frame(late, late, whole), meets ? "nothing" : "");
}

TEST(Mpi, AMeetingOverFramesIsAnErrorOfTheLastToCome) {
  int code = 0;
  {
    MpiCommunicator comm(MPI_COMM_WORLD, std::chrono::seconds(1));
    const auto memory = comm.share(64);
    memory->meet();
    comm.begin_frame(comm.rank() == 0 ? 4 : 5);
    try {
      memory->meet();
    } catch (const Error& error) {
      code = static_cast<int>(error.code());
      // The memory is that of a job which ends.
      if (error.code() == ExitCode::Internal) {
        EXPECT_NE(std::string(error.what()).find("frame 4"), std::string::npos) << error.what();
        EXPECT_NE(std::string(error.what()).find("frame 5"), std::string::npos) << error.what();
      }
    }
  }
  MpiCommunicator comm(MPI_COMM_WORLD);
  std::array<std::uint64_t, 1> seen{static_cast<std::uint64_t>(code == static_cast<int>(ExitCode::Internal))};
  comm.reduce_max(seen, 0);
  if (comm.rank() == 0 && comm.size() > 1) {
    EXPECT_EQ(seen[0], 1U);
  }
  if (comm.size() > 1) {
    EXPECT_TRUE(code == static_cast<int>(ExitCode::Internal) || code == static_cast<int>(ExitCode::Hang)) << code;
  }
}

TEST(Mpi, AReductionOverFramesIsAnErrorOnItsRoot) {
  MpiCommunicator comm(MPI_COMM_WORLD);
  if (comm.size() == 1) return;
  comm.begin_frame(comm.rank() == 0 ? 4 : 5);
  std::array<std::uint64_t, 1> values{1};
  std::string what;
  try {
    comm.reduce_max(values, 1);
  } catch (const Error& error) {
    what = error.what();
  }
  // Those that the root does not wait for have sent all by now, and the root takes what they sent.
  EXPECT_EQ(what, comm.rank() == 1 ? "rank 1 is in frame 5 and reduces with ranks in frames 4 to 5" : "");
}

TEST(Mpi, AWaitEndsAtTheTimeLimitAndNamesTheRank) {
  ExitCode code = ExitCode::Done;
  std::string what;
  {
    MpiCommunicator comm(MPI_COMM_WORLD, std::chrono::milliseconds(200));
    const int silent = (comm.rank() + 1) % comm.size();
    try {
      (void)comm.receive(silent);
    } catch (const Error& error) {
      code = error.code();
      what = error.what();
    }
    EXPECT_NE(what.find("message from rank " + std::to_string(silent)), std::string::npos) << what;
  }
  EXPECT_EQ(code, ExitCode::Hang);
  MPI_Barrier(MPI_COMM_WORLD);
}

TEST(Mpi, TheLongestTimeLimitIsNotTakenForAPassedOne) {
  MpiCommunicator comm(MPI_COMM_WORLD, std::chrono::nanoseconds::max());
  barrier(comm);
  EXPECT_EQ(all_gather_value(comm, 1).size(), static_cast<std::size_t>(comm.size()));
}

TEST(Mpi, AnExchangeOfManyTakesEachMessageWithItsBodies) {
  MpiCommunicator comm(MPI_COMM_WORLD, kHangTimeout, kSmallPart);
  for (const std::size_t size : {std::size_t{0}, std::size_t{5}, kSmallPart, 3 * kSmallPart + 1}) {
    const Bytes head = test::message_of(comm.rank(), size);
    const Bytes part = test::message_of(comm.rank() + 50, size / 2);
    const std::array<std::span<const std::byte>, 2> segments{part, head};
    std::vector<Outgoing> out;
    std::vector<int> from;
    for (int peer = 0; peer < comm.size(); ++peer) {
      if (peer == comm.rank()) continue;
      out.push_back({peer, head, segments});
      from.push_back(peer);
    }
    std::vector<int> came;
    comm.exchange(out, from, [&](int peer, std::span<const std::byte> message) {
      came.push_back(peer);
      EXPECT_TRUE(std::ranges::equal(message, test::message_of(peer, size)));
      Bytes body(size / 2);
      comm.receive(body, peer);
      EXPECT_TRUE(body == test::message_of(peer + 50, size / 2));
      EXPECT_TRUE(comm.receive(peer) == test::message_of(peer, size));
    });
    std::ranges::sort(came);
    EXPECT_EQ(came, from);
  }
}

TEST(Mpi, RanksOfThisHostSeeEachOthersMemoryAndMeet) {
  MpiCommunicator comm(MPI_COMM_WORLD);
  const auto memory = comm.share(1'000'003);
  EXPECT_EQ(memory->mine()[1'000'002], std::byte{0});
  for (int frame = 0; frame < 200; ++frame) {
    memory->mine()[1'000'002] = static_cast<std::byte>(comm.rank() + frame);
    memory->meet();
    for (int peer = 0; peer < comm.size(); ++peer) {
      EXPECT_EQ(memory->of(peer)[1'000'002], static_cast<std::byte>(peer + frame));
    }
    memory->meet();
  }
}

}  // namespace
}  // namespace hpr
