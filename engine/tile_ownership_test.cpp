#include "engine/tile_ownership.h"

#include <gtest/gtest.h>

#include <mutex>
#include <random>

#include "cluster/transport/local_communicator.h"

namespace hpr {
namespace {

Key key_of(std::size_t tile, int sample) {
  return make_key(0.5F, static_cast<std::uint32_t>(tile * 100) + static_cast<std::uint32_t>(sample));
}

/// Tiles dealt to ranks by a hash of tile and sample; every fifth tile is empty.
int owner_of(std::size_t tile, int sample, int ranks) {
  std::mt19937 random(static_cast<std::uint32_t>(tile * 31) + static_cast<std::uint32_t>(sample) * 1009U);
  return static_cast<int>(random() % static_cast<std::uint32_t>(ranks));
}

TEST(TileOwnership, KeysTravelToTheRankThatHadTheTileFirst) {
  const FrameLayout layout({{700, 300}, {64, 1}});
  for (const int ranks : {1, 2, 3, 5}) {
    run_local_ranks(ranks, [&](Communicator& comm) {
      const auto owned_in = [&](int sample) {
        std::vector<std::size_t> owned;
        for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
          if (owner_of(tile, sample, ranks) == comm.rank()) owned.push_back(tile);
        }
        return owned;
      };
      TileOwnership ownership(comm, layout, owned_in(0));
      EXPECT_EQ(ownership.of(comm.rank()), ownership.mine());
      for (const int sample : {0, 1, 2}) {
        TileLayer<Key> layer(layout);
        for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
          // What a rank does not own is scratch, here another sample's keys.
          const bool own = owner_of(tile, sample, ranks) == comm.rank();
          if (own && tile % 5 == 0) continue;
          layer.tile(tile)[7] = key_of(tile, own ? sample : 50);
          layer.set_active(tile);
        }
        ownership.move_to_owners(comm, layer, owned_in(sample));
        for (const std::size_t tile : ownership.mine()) {
          EXPECT_EQ(layer.active(tile), tile % 5 != 0);
          EXPECT_EQ(layer.tile(tile)[7], tile % 5 == 0 ? kNoKey : key_of(tile, sample)) << tile << ' ' << sample;
        }
      }
    });
  }
}

TEST(TileOwnership, ScatteringGivesEachRankItsTiles) {
  const FrameLayout layout({{300, 200}});
  run_local_ranks(3, [&](Communicator& comm) {
    std::vector<std::size_t> owned;
    for (std::size_t tile = static_cast<std::size_t>(comm.rank()); tile < layout.tiles(); tile += 3)
      owned.push_back(tile);
    TileOwnership ownership(comm, layout, owned);
    TileLayer<double> layer(layout);
    if (comm.rank() == 0) {
      for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
        layer.set_active(tile);
        layer.tile(tile)[3] = static_cast<double>(tile) + 0.1;
      }
    }
    ownership.scatter(comm, layer);
    for (const std::size_t tile : owned) EXPECT_EQ(layer.tile(tile)[3], static_cast<double>(tile) + 0.1);
  });
}

}  // namespace
}  // namespace hpr
