#include "compositing/blender.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <tuple>

#include "cluster/transport/communicator_wrappers.h"
#include "cluster/transport/local_communicator.h"
#include "compositing/over.h"
#include "compositing/test_blenders.h"
#include "compositing/test_layers.h"
#include "compositing/test_over.h"
#include "core/error.h"

namespace hpr {
namespace {

/// The promises of Blender::blend, held against every strategy. A new strategy is tested by being listed.
class BlenderTest : public testing::TestWithParam<std::tuple<std::string, int>> {
 protected:
  /// Whether it blends front to back when ranks share hosts like this: then the serial result is met to the bit.
  [[nodiscard]] bool exact(int ranks_per_host) const {
    const bool one_host = ranks_per_host == 0 || ranks_per_host >= ranks_;
    return name_ == "serial" || name_ == "direct-send" || (name_ == "shared-memory" && one_host);
  }
  template <typename Pixel>
  [[nodiscard]] double allowed(int ranks_per_host) const {
    return exact(ranks_per_host) ? 0.0 : test::kAnyAssociation * over_error_bound<Pixel>(ranks_);
  }

  template <typename Pixel>
  void check_tile_lists() const {
    std::uint64_t number = 0;
    for (const auto& [layout, tiles] : test::awkward_tile_lists()) {
      SCOPED_TRACE("tile list " + std::to_string(number));
      const std::vector<int> order = test::random_order(ranks_, number);
      const int ranks_per_host = static_cast<int>(number % 4);
      const LocalRanks ranks{.size = ranks_, .ranks_per_host = ranks_per_host, .disorder = ++number};
      test::Outcome<Pixel> outcome(layout);
      run_local_ranks(ranks, [&, &layout = layout, &tiles = tiles](Communicator& comm) {
        TileLayer<Pixel> layer = test::random_colors<Pixel>(comm.rank(), layout);
        const Composited mine = make_blender<Pixel>(name_)->blend(comm, layer, tiles, order, {});
        outcome.add(layer, mine, {}, comm.rank());
      });
      for (std::size_t tile = 0; tile < layout.tiles(); ++tile) {
        EXPECT_EQ(outcome.owners[tile], std::ranges::binary_search(tiles, tile) ? 1 : 0) << tile;
      }
      EXPECT_EQ(outcome.hidden_tiles, 0U);
      const auto expected = test::serial_over<Pixel>(order, layout);
      EXPECT_LE(test::largest_difference<Pixel>(outcome.frame, expected, tiles), allowed<Pixel>(ranks_per_host));
    }
  }

  template <typename Pixel>
  void check_other_tiles() const {
    const FrameLayout layout({{200, 70}, {65, 65}});
    const std::vector<std::size_t> tiles{1, 2, 5, 8};
    const std::vector<int> order = test::random_order(ranks_, 3);
    run_local_ranks(ranks_, [&](Communicator& comm) {
      TileLayer<Pixel> layer = test::random_colors<Pixel>(comm.rank(), layout);
      const TileLayer<Pixel> before = test::random_colors<Pixel>(comm.rank(), layout);
      (void)make_blender<Pixel>(name_)->blend(comm, layer, tiles, order, {});
      for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
        if (std::ranges::binary_search(tiles, tile)) continue;
        EXPECT_EQ(layer.active(tile), before.active(tile));
        EXPECT_TRUE(std::ranges::equal(layer.tile(tile), before.tile(tile)));
      }
    });
  }

  template <typename Pixel>
  void check_frames_in_shared_memory(int ranks_per_host) const {
    constexpr std::uint64_t kFrames = 3;
    const FrameLayout layout({{200, 70}, {65, 65}, {130, 130}});
    const std::vector<std::size_t> tiles = all_tiles(layout);
    const std::vector<int> shown_by{ranks_ - 1, 0, ranks_ / 2};
    std::vector<std::unique_ptr<test::Outcome<Pixel>>> outcomes;
    for (std::uint64_t frame = 0; frame < kFrames; ++frame)
      outcomes.push_back(std::make_unique<test::Outcome<Pixel>>(layout));
    run_local_ranks({.size = ranks_, .ranks_per_host = ranks_per_host, .disorder = 5}, [&](Communicator& comm) {
      const auto own = make_blender<Pixel>(name_);
      const auto memory = comm.share(TileLayer<Pixel>::bytes_for(layout));
      for (std::uint64_t frame = 0; frame < kFrames; ++frame) {
        TileLayer<Pixel> layer(layout, memory);
        copy_tiles(test::random_colors<Pixel>(comm.rank(), layout, frame), layer, all_tiles(layout));
        const Composited mine = own->blend(comm, layer, tiles, test::random_order(ranks_, frame), shown_by);
        outcomes[frame]->add(layer, mine, shown_by, comm.rank());
      }
    });
    for (std::uint64_t frame = 0; frame < kFrames; ++frame) {
      const test::Outcome<Pixel>& outcome = *outcomes[frame];
      EXPECT_EQ(std::ranges::count(outcome.owners, 1), static_cast<std::ptrdiff_t>(tiles.size()));
      EXPECT_EQ(outcome.astray, 0U);
      const auto expected = test::serial_over<Pixel>(test::random_order(ranks_, frame), layout, frame);
      EXPECT_LE(test::largest_difference<Pixel>(outcome.frame, expected, tiles), allowed<Pixel>(ranks_per_host));
    }
  }

  std::string name_ = std::get<0>(GetParam());
  int ranks_ = std::get<1>(GetParam());
};

TEST_P(BlenderTest, TilesArePartitionedAndHoldTheSerialResultWithinItsBound) {
  ASSERT_TRUE(make_blender<RgbaPremultiplied>(name_)->fits(ranks_));
  check_tile_lists<Rgba8Premultiplied>();
  check_tile_lists<RgbaPremultiplied>();
}

TEST_P(BlenderTest, LeavesTilesThatAreNotListedAlone) {
  check_other_tiles<Rgba8Premultiplied>();
  check_other_tiles<RgbaPremultiplied>();
}

TEST_P(BlenderTest, LayersMayLiveInSharedMemoryAndTheOrderMayChange) {
  for (const int ranks_per_host : {0, 1, 2, 3}) {
    SCOPED_TRACE(ranks_per_host);
    check_frames_in_shared_memory<Rgba8Premultiplied>(ranks_per_host);
    check_frames_in_shared_memory<RgbaPremultiplied>(ranks_per_host);
  }
}

std::string case_name(const testing::TestParamInfo<std::tuple<std::string, int>>& info) {
  std::string name = std::get<0>(info.param) + "_" + std::to_string(std::get<1>(info.param)) + "_ranks";
  std::ranges::replace(name, '-', '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(EveryStrategy, BlenderTest,
                         testing::Combine(testing::ValuesIn(test::every_blender()),
                                          testing::Values(1, 2, 3, 4, 5, 6, 7, 8, 9, 16, 17)),
                         case_name);

}  // namespace
}  // namespace hpr
