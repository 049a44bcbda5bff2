#include "cluster/transport/host_memory.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <mutex>
#include <set>
#include <vector>

#include "cluster/transport/collectives.h"
#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"
#include "core/error.h"

namespace hpr {
namespace {

using namespace std::chrono_literals;

TEST(HostMemory, IsOneBlockForEachHost) {
  for (const int ranks : {1, 2, 3, 4, 7}) {
    for (const int per_host : {0, 1, 2, 3}) {
      std::mutex mutex;
      std::set<const std::byte*> blocks;
      std::atomic<int> firsts = 0;
      run_local_ranks({.size = ranks, .ranks_per_host = per_host}, [&](Communicator& comm) {
        HostMemory memory(comm, 10'000);
        ASSERT_EQ(memory.bytes().size(), 10'000U);
        const int first = per_host == 0 ? 0 : comm.rank() / per_host * per_host;
        const int here = per_host == 0 ? ranks : std::min(per_host, ranks - first);
        EXPECT_EQ(memory.ranks(), here);
        EXPECT_EQ(memory.is_first(), comm.rank() == first);
        EXPECT_EQ(std::ranges::count(memory.bytes(), std::byte{0}), 10'000);
        memory.meet();
        memory.bytes()[static_cast<std::size_t>(comm.rank())] = std::byte{7};
        memory.meet();
        EXPECT_EQ(std::ranges::count(memory.bytes(), std::byte{7}), here);
        if (memory.is_first()) ++firsts;
        {
          const std::lock_guard lock(mutex);
          blocks.insert(memory.bytes().data());
        }
        barrier(comm);  // until then no block goes, nor comes again at its address
      });
      EXPECT_EQ(static_cast<int>(blocks.size()), firsts) << ranks << " ranks, " << per_host << " a host";
    }
  }
}

TEST(HostMemory, GivesBackWholePages) {
  run_local_ranks(3, [&](Communicator& comm) {
    HostMemory memory(comm, 5 * 4096);
    if (memory.is_first()) std::ranges::fill(memory.bytes(), std::byte{9});
    memory.meet();
    if (memory.is_first()) HostMemory::release(memory.bytes().subspan(100, 3 * 4096));  // pages 1 and 2 are whole
    memory.meet();
    EXPECT_EQ(std::ranges::count(memory.bytes(), std::byte{9}), 3 * 4096);
    EXPECT_EQ(std::ranges::count(memory.bytes().subspan(4096, 2 * 4096), std::byte{0}), 2 * 4096);
    memory.meet();
  });
}

TEST(HostMemory, NobodyWaitsForEver) {
  run_local_ranks(2, [&](Communicator& comm) {
    HostMemory memory(comm, 8, 50ms);
    if (comm.rank() == 0) {
      ExitCode code = ExitCode::Done;
      try {
        memory.meet();
      } catch (const Error& error) {
        code = error.code();
      }
      EXPECT_EQ(code, ExitCode::Hang);
    }
    barrier(comm);
  });
}

TEST(HostMemory, RanksWaitAsLongAsForMessages) {
  run_local_ranks(
      2,
      [](Communicator& comm) {
        EXPECT_EQ(comm.hang_timeout(), 321ms);
        EXPECT_EQ(CountingCommunicator(comm).hang_timeout(), 321ms);
      },
      321ms);
  EXPECT_THROW(run_local_ranks(
                   2,
                   [](Communicator& comm) {
                     HostMemory memory(comm, 8);
                     if (comm.rank() == 0) memory.meet();
                   },
                   200ms),
               Error);
}

TEST(HostMemory, OutlivesWhoeverMadeIt) {
  std::vector<std::unique_ptr<HostMemory>> kept(2);
  run_local_ranks(2, [&](Communicator& comm) {
    auto& mine = kept[static_cast<std::size_t>(comm.rank())];
    mine = std::make_unique<HostMemory>(comm, 64);
    if (comm.rank() == 1) mine->bytes()[5] = std::byte{3};
  });
  kept[0].reset();
  EXPECT_EQ(kept[1]->bytes()[5], std::byte{3});
}

}  // namespace
}  // namespace hpr
