#include "compositing/assembly.h"

#include <gtest/gtest.h>

#include <random>

#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"
#include "compositing/compositor.h"
#include "compositing/test_layers.h"
#include "core/error.h"
#include "image/color.h"

namespace hpr {
namespace {

const FrameLayout kWall({{200, 130}, {64, 64}, {65, 1}, {130, 70}});

/// Deals every tile to one of `ranks` ranks at random, in stretches; -1 is nobody.
std::vector<int> random_owners(int ranks, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<int> owners;
  while (owners.size() < kWall.tiles()) {
    const int owner = static_cast<int>(random() % static_cast<std::uint64_t>(ranks + 1)) - 1;
    owners.insert(owners.end(), 1 + random() % 5, owner);
  }
  owners.resize(kWall.tiles());
  return owners;
}

/// A pixel that encodes its position, so that a misplaced one shows where it came from. Every third tile is empty.
template <typename Pixel>
Pixel marked(std::size_t tile, std::size_t pixel) {
  if (tile % 3 == 1) return Pixel{};
  if constexpr (std::is_same_v<Pixel, Rgb>) {
    return {static_cast<float>(tile), static_cast<float>(pixel), 1.0F};
  } else {
    return static_cast<Pixel>(tile * kTilePixels + pixel + 1);
  }
}

template <typename Pixel>
void fill(TileLayer<Pixel>& layer, std::size_t tile, bool garbage) {
  if (!garbage && tile % 3 == 1) return;
  layer.set_active(tile);
  for (std::size_t i = 0; i < kTilePixels; ++i) {
    layer.tile(tile)[i] = marked<Pixel>(garbage ? (tile + 1) * 3 : tile, i);
  }
}

template <typename Pixel>
void expect_tiles_reach_their_screens(int ranks, const std::vector<int>& shown_by, std::uint64_t seed) {
  const std::vector<int> owners = random_owners(ranks, seed);
  run_local_ranks(ranks, [&](Communicator& comm) {
    TileLayer<Pixel> layer(kWall);
    std::vector<std::size_t> owned;
    for (std::size_t tile = 0; tile < kWall.tiles(); ++tile) {
      if (owners[tile] == comm.rank()) owned.push_back(tile);
      // Tiles of others hold scratch, as a strategy leaves it.
      if (owners[tile] == comm.rank() || tile % 2 == 0) fill(layer, tile, owners[tile] != comm.rank());
    }
    Assembler().assemble(comm, layer, std::span<const std::size_t>(owned), shown_by);
    for (std::size_t tile = 0; tile < kWall.tiles(); ++tile) {
      if (shown_by[kWall.place(tile).screen] != comm.rank()) continue;
      const bool empty = owners[tile] < 0 || tile % 3 == 1;
      EXPECT_EQ(layer.active(tile), !empty) << "tile " << tile;
      std::size_t wrong = 0;
      for (std::size_t i = 0; i < kTilePixels; ++i) {
        wrong += layer.tile(tile)[i] == (empty ? Pixel{} : marked<Pixel>(tile, i)) ? 0U : 1U;
      }
      EXPECT_EQ(wrong, 0U) << "tile " << tile;
    }
  });
}

TEST(Assembly, EveryTileReachesTheRankThatShowsItsScreen) {
  std::uint64_t seed = 1;
  for (const int ranks : {1, 2, 3, 4, 5, 8, 17}) {
    const int last = ranks - 1;
    expect_tiles_reach_their_screens<Key>(ranks, {0, 0, 0, 0}, seed++);
    expect_tiles_reach_their_screens<Key>(ranks, {last, 0, last, 0}, seed++);
    expect_tiles_reach_their_screens<Key>(ranks, {0, 1 % ranks, 2 % ranks, 3 % ranks}, seed++);
  }
}

TEST(Assembly, PixelsMayBeLight) {
  expect_tiles_reach_their_screens<Rgb>(3, {2, 1, 0, 2}, 7);
}

TEST(Assembly, BringsWhatEveryStrategyLeavesToEveryScreen) {
  const std::vector<std::size_t> tiles = all_tiles(kWall);
  for (const auto& listed : all_compositors()) {
    for (const int ranks : {1, 3, 4}) {
      const std::vector<Key> expected = test::expected_keys(ranks, kWall);
      const std::vector<int> shown_by{ranks - 1, 0, 0, ranks / 2};
      run_local_ranks(ranks, [&](Communicator& comm) {
        TileLayer<Key> layer = test::random_layer(comm.rank(), kWall);
        const auto compositor = make_compositor(listed->name());
        const Composited mine = compositor->composite(comm, layer, tiles);
        Assembler().assemble(comm, layer, mine.tiles, shown_by);
        for (const std::size_t tile : tiles) {
          if (shown_by[kWall.place(tile).screen] != comm.rank()) continue;
          EXPECT_TRUE(
              std::ranges::equal(layer.tile(tile), std::span(expected).subspan(tile * kTilePixels, kTilePixels)))
              << compositor->name() << " tile " << tile;
        }
      });
    }
  }
}

TEST(Assembly, SendsOnlyToRanksThatShowSomething) {
  run_local_ranks(4, [](Communicator& comm) {
    CountingCommunicator counting(comm);
    TileLayer<Key> layer(kWall);
    std::vector<std::size_t> owned;
    if (comm.rank() == 3) owned = {0, 1};
    Assembler().assemble(counting, layer, std::span<const std::size_t>(owned), std::vector<int>{0, 0, 2, 0});
    EXPECT_EQ(counting.messages_sent(), comm.rank() % 2 == 0 ? 1U : 2U);
    EXPECT_EQ(counting.bytes_sent() == 0, comm.rank() != 3);
  });
}

TEST(Assembly, RefusesTwoOwnersOfOneTile) {
  EXPECT_THROW(run_local_ranks(3,
                               [](Communicator& comm) {
                                 TileLayer<Key> layer(kWall);
                                 const std::vector<std::size_t> owned{4};
                                 Assembler().assemble(comm, layer, std::span<const std::size_t>(owned),
                                                      std::vector<int>(4, 0));
                               }),
               Error);
}

}  // namespace
}  // namespace hpr
