#include "compositing/activity.h"

#include <gtest/gtest.h>

#include <random>

#include "cluster/transport/local_communicator.h"
#include "compositing/test_layers.h"

namespace hpr {
namespace {

Activity random_activity(int ranks, std::size_t tiles, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const std::size_t words = (tiles + 15) / 16;
  std::vector<std::uint64_t> fills(words * static_cast<std::size_t>(ranks));
  for (std::size_t rank = 0; rank < static_cast<std::size_t>(ranks); ++rank) {
    for (std::size_t i = random() % (tiles + 1); i < tiles; i += 1 + random() % 3) {
      fills[rank * words + i / 16] |= kFullTile << (4 * (i % 16));
    }
  }
  return {ranks, tiles, std::move(fills)};
}

TEST(Activity, EveryRankLearnsWhatEachHasDrawn) {
  const FrameLayout layout({{700, 500}, {65, 65}});
  const std::vector<std::size_t> tiles{0, 1, 5, 6, 7, 40, 70, 87, 88, 89, 90, 91};
  std::vector<TileLayer<Key>> layers;
  for (int rank = 0; rank < 13; ++rank) layers.push_back(test::random_layer(rank, layout));
  for (const int ranks : {1, 2, 3, 5, 8, 13}) {
    run_local_ranks(ranks, [&](Communicator& comm) {
      const Activity activity = share_activity(comm, layers[static_cast<std::size_t>(comm.rank())], tiles);
      for (std::size_t i = 0; i < tiles.size(); ++i) {
        std::uint32_t weight = 0;
        for (int rank = 0; rank < ranks; ++rank) {
          const bool active = layers[static_cast<std::size_t>(rank)].active(tiles[i]);
          EXPECT_EQ(activity.active(rank, i), active);
          weight += active ? 1 : 0;
        }
        EXPECT_EQ(activity.weight(i), weight);
      }
    });
  }
}

TEST(Activity, CutsAreInOrderCoverTheRunAndAreAsEvenAsTilesAllow) {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const int ranks = 1 + static_cast<int>(seed % 9);
    const Activity activity = random_activity(ranks, 1 + seed * 7 % 300, seed);
    const TileRun run{seed % 5 % activity.tiles(), activity.tiles() - seed % 5 % activity.tiles()};
    for (const int parts : {1, 2, 3, 8}) {
      const std::vector<TileRun> cuts = activity.cut(run, parts);
      ASSERT_EQ(cuts.size(), static_cast<std::size_t>(parts));
      std::size_t next = run.first;
      std::uint64_t all = 0;
      for (std::size_t i = run.first; i < run.end(); ++i) all += activity.weight(i);
      for (const TileRun& cut : cuts) {
        EXPECT_EQ(cut.first, next);
        next = cut.end();
        std::uint64_t weight = 0;
        for (std::size_t i = cut.first; i < cut.end(); ++i) weight += activity.weight(i);
        // A tile too many at either end, and what empty tiles weigh.
        const double limit = static_cast<double>(all) / parts + static_cast<double>(run.count) / 64.0;
        EXPECT_LE(static_cast<double>(weight), limit + ranks + 1.0);
      }
      EXPECT_EQ(next, run.end());
    }
  }
}

TEST(Activity, PiecesAreCutByPixelsNotByTiles) {
  // The left half of the frame is full, of the right half every tile holds a sixteenth.
  const FrameLayout layout({{64 * 32, 64}});
  TileLayer<Key> layer(layout);
  for (std::size_t tile = 0; tile < 32; ++tile) {
    const auto pixels = layer.tile(tile);
    for (std::size_t i = 0; i < kTilePixels; ++i) {
      if (tile < 16 || i % kTileSide < 4) pixels[i] = make_key(0.5F, 1);
    }
    layer.set_active(tile);
  }
  run_local_ranks(3, [&](Communicator& comm) {
    const std::vector<TileRun> cuts = share_activity(comm, layer, all_tiles(layout)).cut({0, 32}, 2);
    EXPECT_GE(cuts[0].count, 8U);
    EXPECT_LE(cuts[0].count, 10U) << "ten full tiles weigh as much as six and sixteen nearly empty ones";
  });
}

TEST(Activity, AListNobodyDrewIntoIsCutEvenly) {
  const Activity nothing(3, 100, std::vector<std::uint64_t>(21));
  for (const TileRun& cut : nothing.cut({0, 100}, 4)) EXPECT_EQ(cut.count, 25U);
  EXPECT_EQ(nothing.cut({10, 0}, 2), (std::vector<TileRun>{{10, 0}, {10, 0}}));
}

}  // namespace
}  // namespace hpr
