#include "cluster/distribution/chunk_exchange.h"

#include <gtest/gtest.h>

#include <cstdint>

#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"

namespace hpr {
namespace {

constexpr std::size_t kScreens = 3;

/// Whether a chunk may be seen in the area of a rank on a screen: by chance, more often where another one is.
bool is_found(std::uint32_t chunk, int owner, std::size_t screen) {
  std::uint32_t random = chunk / 3 * 31U + static_cast<std::uint32_t>(owner) * 7U + static_cast<std::uint32_t>(screen);
  random = (random ^ random >> 13U) * 0x5bd1e995U;
  return (random ^ random >> 15U) % 4U == 0U;
}

std::vector<ChunkRange> found_in(const ChunkRange& part, int owner, std::size_t screen) {
  std::vector<ChunkRange> ranges;
  for (std::uint32_t chunk = part.first; chunk < part.last; ++chunk) {
    if (is_found(chunk, owner, screen)) append_range(ranges, {chunk, chunk + 1});
  }
  return ranges;
}

TEST(ChunkExchange, SharesAreAsEvenAsTheyCanBe) {
  for (const std::uint32_t chunks : {0U, 1U, 5U, 1000U, 4294967295U}) {
    for (const int ranks : {1, 2, 3, 7, 64}) {
      std::uint32_t end = 0;
      for (int rank = 0; rank < ranks; ++rank) {
        const ChunkRange part = part_of_chunks(chunks, rank, ranks);
        EXPECT_EQ(part.first, end);
        end = part.last;
        const std::uint32_t even = chunks / static_cast<std::uint32_t>(ranks);
        EXPECT_TRUE(part.count() == even || part.count() == even + 1) << chunks << ' ' << ranks << ' ' << rank;
      }
      EXPECT_EQ(end, chunks);
    }
  }
}

TEST(ChunkExchange, EveryOwnerHasWhatAllFoundForIt) {
  for (const std::uint32_t chunks : {0U, 2U, 400U, 70000U}) {
    for (const int ranks : {1, 2, 3, 4, 7, 8}) {
      run_local_ranks({.size = ranks, .disorder = 11}, [&](Communicator& local) {
        CountingCommunicator comm(local);
        const ChunkRange part = part_of_chunks(chunks, comm.rank(), ranks);
        std::vector<ScreenChunks> found(static_cast<std::size_t>(ranks), ScreenChunks(kScreens));
        std::size_t ranges = 0;
        for (int owner = 0; owner < ranks; ++owner) {
          for (std::size_t screen = 0; screen < kScreens; ++screen) {
            auto& list = found[static_cast<std::size_t>(owner)][screen];
            list = found_in(part, owner, screen);
            if (owner != comm.rank()) ranges += list.size();
          }
        }
        const ScreenChunks mine = exchange_chunks(comm, found);
        ASSERT_EQ(mine.size(), kScreens);
        for (std::size_t screen = 0; screen < kScreens; ++screen) {
          EXPECT_EQ(mine[screen], found_in({0, chunks}, comm.rank(), screen)) << chunks << ' ' << ranks;
        }
        // One message to each other rank, of about two bytes a range.
        EXPECT_EQ(comm.messages_sent(), static_cast<std::size_t>(ranks - 1));
        EXPECT_LE(comm.bytes_sent(), 2 * ranges + static_cast<std::size_t>(ranks - 1) * kScreens * 6);
      });
    }
  }
}

TEST(ChunkExchange, RangesKeepTheirNumbersWhateverTheirSize) {
  run_local_ranks(2, [](Communicator& comm) {
    const std::vector<ChunkRange> some{
        {0, 1}, {127, 128}, {256, 16640}, {2097152, 4294967290U}, {4294967294U, 4294967295U}};
    std::vector<ScreenChunks> found(2, ScreenChunks(2));
    if (comm.rank() == 0) found[1][1] = some;
    const ScreenChunks mine = exchange_chunks(comm, found);
    EXPECT_EQ(mine, comm.rank() == 1 ? ScreenChunks({{}, some}) : ScreenChunks(2));
  });
}

}  // namespace
}  // namespace hpr
