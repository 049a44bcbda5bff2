#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "cluster/transport/local_communicator.h"
#include "compositing/compositor.h"
#include "compositing/test_layers.h"
#include "core/error.h"

/// The promises of Compositor::composite, as GoogleTests for any strategy. Include it in one source of a test program,
/// which also says which strategies are to keep them:
///
///   INSTANTIATE_TEST_SUITE_P(Mine, CompositorContract, testing::ValuesIn(contract_cases(make)), contract_case_name);
namespace hpr::test {

/// One strategy on one number of ranks.
struct ContractCase {
  std::string name;
  MakeCompositor make;
  int ranks = 1;
};

/// A strategy on every number of ranks it fits, of those at which strategies tend to break.
inline std::vector<ContractCase> contract_cases(const MakeCompositor& make) {
  std::vector<ContractCase> cases;
  const auto compositor = make();
  for (const int ranks : {1, 2, 3, 4, 5, 7, 8, 12, 16, 17}) {
    if (compositor->fits(ranks)) cases.push_back({std::string(compositor->name()), make, ranks});
  }
  return cases;
}

inline std::string contract_case_name(const testing::TestParamInfo<ContractCase>& info) {
  std::string name = info.param.name + "_" + std::to_string(info.param.ranks) + "_ranks";
  std::ranges::replace_if(
      name, [](unsigned char letter) { return std::isalnum(letter) == 0; }, '_');
  return name;
}

class CompositorContract : public testing::TestWithParam<ContractCase> {
 protected:
  /// A rank's own.
  static std::unique_ptr<Compositor> compositor() { return GetParam().make(); }
  int ranks_ = GetParam().ranks;
};

TEST_P(CompositorContract, RunsPartitionTheTilesAndHoldTheSerialMaximum) {
  std::size_t number = 0;
  for (const auto& [layout, tiles] : awkward_tile_lists()) {
    SCOPED_TRACE("tile list " + std::to_string(number++));
    const std::vector<Key> expected = expected_keys(ranks_, layout);
    std::vector<int> owners(tiles.size(), 0);
    std::size_t wrong_keys = 0;
    std::size_t hidden_tiles = 0;  // hold keys but are not marked as active: they would be lost on the way to a screen
    std::mutex mutex;
    run_local_ranks(ranks_, [&, &tiles = tiles, &layout = layout](Communicator& comm) {
      TileLayer<Key> layer = random_layer(comm.rank(), layout);
      const Composited mine = compositor()->composite(comm, layer, tiles);
      const std::lock_guard lock(mutex);
      EXPECT_TRUE(std::ranges::is_sorted(mine.tiles));
      for (const std::size_t tile : mine.tiles) {
        const auto position = std::ranges::lower_bound(tiles, tile) - tiles.begin();
        ++owners.at(static_cast<std::size_t>(position));
        const auto keys = layer.tile(tile);
        for (std::size_t p = 0; p < kTilePixels; ++p) {
          wrong_keys += keys[p] == expected[tile * kTilePixels + p] ? 0U : 1U;
        }
      }
      for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
        if (!layer.active(tile) && std::ranges::any_of(layer.tile(tile), [](Key key) { return key != kNoKey; })) {
          ++hidden_tiles;
        }
      }
    });
    EXPECT_EQ(std::ranges::count(owners, 1), static_cast<std::ptrdiff_t>(tiles.size()));
    EXPECT_EQ(wrong_keys, 0U);
    EXPECT_EQ(hidden_tiles, 0U);
  }
}

TEST_P(CompositorContract, LeavesTilesThatAreNotListedAlone) {
  const FrameLayout layout({{200, 70}, {65, 65}});
  const std::vector<std::size_t> tiles{1, 2, 5, 8};
  run_local_ranks(ranks_, [&](Communicator& comm) {
    TileLayer<Key> layer = random_layer(comm.rank(), layout);
    const TileLayer<Key> before = random_layer(comm.rank(), layout);
    (void)compositor()->composite(comm, layer, tiles);
    for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
      if (std::ranges::binary_search(tiles, tile)) continue;
      EXPECT_EQ(layer.active(tile), before.active(tile));
      EXPECT_TRUE(std::ranges::equal(layer.tile(tile), before.tile(tile)));
    }
  });
}

TEST_P(CompositorContract, EqualLayersGiveThatLayer) {
  const FrameLayout layout({{130, 70}});
  const std::vector<std::size_t> tiles = all_tiles(layout);
  const TileLayer<Key> same = random_layer(0, layout);
  run_local_ranks(ranks_, [&](Communicator& comm) {
    TileLayer<Key> layer = random_layer(0, layout);
    const Composited mine = compositor()->composite(comm, layer, tiles);
    for (const std::size_t tile : mine.tiles) EXPECT_TRUE(std::ranges::equal(layer.tile(tile), same.tile(tile)));
  });
}

TEST_P(CompositorContract, LayersMayLiveInSharedMemoryAndTheirScreensBeShown) {
  const FrameLayout layout({{200, 70}, {65, 65}, {130, 130}});
  const std::vector<std::size_t> tiles = all_tiles(layout);
  const std::vector<Key> expected = expected_keys(ranks_, layout);
  const std::vector<int> shown_by{ranks_ - 1, 0, ranks_ / 2};
  for (const int ranks_per_host : {0, 1, 2, 3}) {
    SCOPED_TRACE(ranks_per_host);
    std::vector<int> owners(tiles.size(), 0);
    std::size_t wrong_tiles = 0;
    std::size_t astray = 0;  // owned by another rank than the one that shows them, though said to be assembled
    std::mutex mutex;
    run_local_ranks({.size = ranks_, .ranks_per_host = ranks_per_host, .disorder = 5}, [&](Communicator& comm) {
      const auto own = compositor();
      const auto memory = comm.share(TileLayer<Key>::bytes_for(layout));
      for (int frame = 0; frame < 3; ++frame) {
        TileLayer<Key> layer(layout, memory);
        copy_tiles(random_layer(comm.rank(), layout), layer, all_tiles(layout));
        const Composited mine = own->composite(comm, layer, tiles, shown_by);
        const std::lock_guard lock(mutex);
        for (const std::size_t tile : mine.tiles) {
          ++owners[tile];
          const auto want = std::span(expected).subspan(tile * kTilePixels, kTilePixels);
          wrong_tiles += std::ranges::equal(layer.tile(tile), want) ? 0U : 1U;
          astray += mine.assembled && shown_by[layout.place(tile).screen] != comm.rank() ? 1U : 0U;
        }
      }
    });
    EXPECT_EQ(std::ranges::count(owners, 3), static_cast<std::ptrdiff_t>(tiles.size()));
    EXPECT_EQ(wrong_tiles, 0U);
    EXPECT_EQ(astray, 0U);
  }
}

TEST_P(CompositorContract, ARankThatLeftOutAFrameIsNamedWithBothFrames) {
  if (ranks_ == 1) return;
  const FrameLayout layout({{130, 70}});
  const std::vector<std::size_t> tiles = all_tiles(layout);
  try {
    run_local_ranks(
        ranks_,
        [&](Communicator& comm) {
          const auto own = compositor();
          for (const std::uint64_t frame : {7U, 8U}) {
            TileLayer<Key> layer = random_layer(comm.rank(), layout);
            comm.begin_frame(frame == 8 && comm.rank() == ranks_ - 1 ? 9 : frame);
            (void)own->composite(comm, layer, tiles);
          }
        },
        std::chrono::seconds(20));
    ADD_FAILURE() << "frame 8 was composited with frame 9";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Internal);
    const std::string what = error.what();
    EXPECT_TRUE(what.find("frame 8") != std::string::npos && what.find("frame 9") != std::string::npos) << what;
  }
}

TEST_P(CompositorContract, MessagesThatOvertakeEachOtherEndTheJob) {
  if (ranks_ == 1) return;
  const FrameLayout layout({{130, 70}});
  const std::vector<std::size_t> tiles = all_tiles(layout);
  const LocalRanks ranks{.size = ranks_, .hang_timeout = std::chrono::milliseconds(500), .overtaking = ranks_ - 1};
  try {
    run_local_ranks(ranks, [&](Communicator& comm) {
      const auto own = compositor();
      for (std::uint64_t frame = 1; frame <= 3; ++frame) {
        TileLayer<Key> layer = random_layer(comm.rank(), layout);
        comm.begin_frame(frame);
        (void)own->composite(comm, layer, tiles);
      }
    });
    ADD_FAILURE() << "frames were composited of each other's messages";
  } catch (const Error& error) {
    // Where the rank itself waits for what its peers cannot do yet, no message of its next frame comes.
    EXPECT_TRUE(error.code() == ExitCode::Internal || error.code() == ExitCode::Hang) << error.what();
  }
}

}  // namespace hpr::test
