#include "compositing/binary_swap.h"

#include <gtest/gtest.h>

#include <bit>

#include "cluster/counting_communicator.h"
#include "cluster/local_communicator.h"
#include "compositing/synthetic.h"
#include "compositing/test_layers.h"

namespace hpr {
namespace {

/// What a message of tiles needs beside its pixels at most: how it is written, and one bit per tile, in words.
std::size_t head_bytes(std::size_t tiles) {
  return 8 + (tiles + 63) / 64 * 8;
}

// Ma et al. 1994, section 3: log2 P messages and N (1 - 1/P) pixels sent per rank.
TEST(BinarySwap, SendsWhatThePaperSays) {
  for (const Size size : {Size{512, 256}, Size{333, 217}}) {
    for (const unsigned ranks : {1U, 2U, 4U, 8U, 16U}) {
      run_local_ranks(static_cast<int>(ranks), [&](Communicator& comm) {
        CountingCommunicator counting(comm);
        TileLayer<Key> layer = synthetic_layer(SyntheticKind::Dense, comm.rank(), size, 1);
        const std::vector<std::size_t> tiles = test::all_tiles(layer.layout());
        const TileRun mine = BinarySwap().composite(counting, layer, tiles);
        const auto rounds = static_cast<std::size_t>(std::bit_width(ranks)) - 1;
        EXPECT_EQ(counting.messages_sent(), rounds);
        // Whoever keeps n of N tiles has given away all the others, each exactly once.
        const std::size_t pixels = (tiles.size() - mine.count) * kTilePixels * sizeof(Key);
        EXPECT_GE(counting.bytes_sent(), pixels);
        EXPECT_LE(counting.bytes_sent(), pixels + rounds * head_bytes(tiles.size()));
        EXPECT_NEAR(static_cast<double>(mine.count), static_cast<double>(tiles.size()) / ranks, 1.0);
      });
    }
  }
}

TEST(BinarySwap, RanksBeyondAPowerOfTwoSendOneLayerAndOwnNothing) {
  run_local_ranks(6, [](Communicator& comm) {
    CountingCommunicator counting(comm);
    TileLayer<Key> layer = synthetic_layer(SyntheticKind::Dense, comm.rank(), {512, 256}, 1);
    const std::vector<std::size_t> tiles = test::all_tiles(layer.layout());
    const TileRun mine = BinarySwap().composite(counting, layer, tiles);
    const bool folded = comm.rank() == 1 || comm.rank() == 3;
    EXPECT_EQ(counting.messages_sent(), folded ? 1U : 2U);
    EXPECT_EQ(mine.count, folded ? 0U : tiles.size() / 4);
  });
}

TEST(BinarySwap, EmptyTilesCostABit) {
  run_local_ranks(4, [](Communicator& comm) {
    CountingCommunicator counting(comm);
    TileLayer<Key> layer(FrameLayout({{4096, 2048}}));
    const std::vector<std::size_t> tiles = test::all_tiles(layer.layout());
    (void)BinarySwap().composite(counting, layer, tiles);
    EXPECT_EQ(counting.bytes_sent(), 8 + 1024 / 8 + 8 + 512 / 8);
  });
}

}  // namespace
}  // namespace hpr
