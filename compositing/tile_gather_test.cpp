#include "compositing/tile_gather.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <mutex>
#include <random>

#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"

namespace hpr {
namespace {

/// Keys of a rank in the tiles it may draw into; in some of them there are none.
TileLayer<Key> layer_of(int rank, const FrameLayout& layout, std::span<const std::size_t> drawn) {
  std::mt19937_64 random(static_cast<std::uint64_t>(rank) + 1);
  TileLayer<Key> layer(layout);
  for (const std::size_t tile : drawn) {
    const auto pixels = layer.tile(tile);
    const std::uint64_t kind = random() % 4;
    if (kind == 0) continue;
    for (Key& key : pixels) {
      if (kind == 1 || random() % 8 == 0) key = random() >> 2U;
    }
    layer.set_active(tile);
  }
  return layer;
}

TEST(TileGather, OwnersHaveTheNearestKeysOfAllWhoDrawIntoATile) {
  const FrameLayout layout({{300, 200}, {100, 64}});
  for (const int ranks : {1, 2, 3, 5, 8}) {
    std::mt19937 random(static_cast<unsigned>(ranks));
    std::vector<std::vector<std::size_t>> drawn(static_cast<std::size_t>(ranks));
    std::vector<int> owners;
    for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
      std::vector<int> who;
      for (int rank = 0; rank < ranks; ++rank) {
        if (random() % 3 != 0) continue;
        drawn[static_cast<std::size_t>(rank)].push_back(tile);
        who.push_back(rank);
      }
      owners.push_back(who.empty() ? static_cast<int>(random() % static_cast<unsigned>(ranks))
                                   : who[random() % who.size()]);
    }
    TileLayer<Key> expected(layout);
    for (int rank = 0; rank < ranks; ++rank) {
      const TileLayer<Key> layer = layer_of(rank, layout, drawn[static_cast<std::size_t>(rank)]);
      for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
        std::ranges::transform(layer.tile(tile), expected.tile(tile), expected.tile(tile).begin(),
                               [](Key a, Key b) { return std::max(a, b); });
      }
    }
    std::mutex mutex;
    std::vector<int> seen(layout.tiles(), 0);
    run_local_ranks(ranks, [&](Communicator& comm) {
      CountingCommunicator counting(comm);
      TileGather gather;
      for (int frame = 0; frame < 2; ++frame) {
        TileLayer<Key> layer = layer_of(comm.rank(), layout, drawn[static_cast<std::size_t>(comm.rank())]);
        const std::vector<std::size_t> mine = gather.composite(counting, layer, drawn, owners);
        const std::lock_guard lock(mutex);
        for (const std::size_t tile : mine) {
          EXPECT_EQ(owners[tile], comm.rank());
          EXPECT_TRUE(std::ranges::equal(layer.tile(tile), std::as_const(expected).tile(tile))) << tile;
          ++seen[tile];
        }
      }
    });
    EXPECT_EQ(std::ranges::count(seen, 2), static_cast<std::ptrdiff_t>(layout.tiles()));
  }
}

TEST(TileGather, RanksThatShareNoTileSendNothing) {
  const FrameLayout layout({{256, 64}});
  const std::vector<std::vector<std::size_t>> drawn{{0, 1}, {1, 2}, {3}};
  const std::vector<int> owners{0, 0, 1, 2};
  run_local_ranks(3, [&](Communicator& comm) {
    CountingCommunicator counting(comm);
    TileLayer<Key> layer = layer_of(comm.rank(), layout, drawn[static_cast<std::size_t>(comm.rank())]);
    TileGather gather;
    (void)gather.composite(counting, layer, drawn, owners);
    EXPECT_EQ(counting.bytes_sent() > 0, comm.rank() == 1);
  });
}

}  // namespace
}  // namespace hpr
