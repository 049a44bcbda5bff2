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
#include "compositing/compositor.h"
#include "compositing/kernels.h"
#include "compositing/test_layers.h"
#include "core/error.h"

namespace hpr {
namespace {

constexpr double kAnyAssociation = 2.0;  // bounds against the exact result hold twice between two associations

/// What all ranks of a run end up with.
template <typename Pixel>
struct Outcome {
  explicit Outcome(const FrameLayout& layout) : frame(layout.tiles() * kTilePixels), owners(layout.tiles(), 0) {}

  std::vector<Pixel> frame;
  std::vector<int> owners;       ///< per tile of the frame
  std::size_t hidden_tiles = 0;  ///< hold colours but are not marked as active
  std::size_t astray = 0;        ///< owned by another rank than the one that shows them, though said to be assembled
  std::mutex mutex;

  void add(const TileLayer<Pixel>& layer, const Composited& mine, std::span<const int> shown_by, int rank) {
    const std::lock_guard lock(mutex);
    EXPECT_TRUE(std::ranges::is_sorted(mine.tiles));
    for (const std::size_t tile : mine.tiles) {
      ++owners[tile];
      std::ranges::copy(layer.tile(tile), frame.begin() + static_cast<std::ptrdiff_t>(tile * kTilePixels));
      astray += mine.assembled && shown_by[layer.layout().place(tile).screen] != rank ? 1U : 0U;
    }
    for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
      if (layer.active(tile)) continue;
      hidden_tiles += std::ranges::all_of(layer.tile(tile), [](Pixel p) { return p == Pixel{}; }) ? 0U : 1U;
    }
  }
};

template <typename Pixel>
std::vector<Pixel> blended(const std::string& name, const LocalRanks& ranks, std::span<const int> order,
                           const FrameLayout& layout, std::uint64_t seed = 1) {
  const std::vector<std::size_t> tiles = all_tiles(layout);
  Outcome<Pixel> outcome(layout);
  run_local_ranks(ranks, [&](Communicator& comm) {
    TileLayer<Pixel> layer = test::random_colors<Pixel>(comm.rank(), layout, seed);
    const Composited mine = make_blender<Pixel>(name)->blend(comm, layer, tiles, order, {});
    outcome.add(layer, mine, {}, comm.rank());
  });
  return outcome.frame;
}

/// The largest difference in the listed tiles.
template <typename Pixel>
double largest_difference(std::span<const Pixel> a, std::span<const Pixel> b, std::span<const std::size_t> tiles) {
  double largest = 0.0;
  for (const std::size_t tile : tiles) {
    for (std::size_t i = tile * kTilePixels; i < (tile + 1) * kTilePixels; ++i) {
      largest = std::max(largest, test::difference(a[i], b[i]));
    }
  }
  return largest;
}

std::vector<std::string> every_blender() {
  std::vector<std::string> names;
  for (const auto& blender : all_blenders<RgbaPremultiplied>()) names.emplace_back(blender->name());
  return names;
}

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
    return exact(ranks_per_host) ? 0.0 : kAnyAssociation * over_error_bound<Pixel>(ranks_);
  }

  template <typename Pixel>
  void check_tile_lists() const {
    std::uint64_t number = 0;
    for (const auto& [layout, tiles] : test::awkward_tile_lists()) {
      SCOPED_TRACE("tile list " + std::to_string(number));
      const std::vector<int> order = test::random_order(ranks_, number);
      const int ranks_per_host = static_cast<int>(number % 4);
      const LocalRanks ranks{.size = ranks_, .ranks_per_host = ranks_per_host, .disorder = ++number};
      Outcome<Pixel> outcome(layout);
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
      EXPECT_LE(largest_difference<Pixel>(outcome.frame, expected, tiles), allowed<Pixel>(ranks_per_host));
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
    std::vector<std::unique_ptr<Outcome<Pixel>>> outcomes;
    for (std::uint64_t frame = 0; frame < kFrames; ++frame)
      outcomes.push_back(std::make_unique<Outcome<Pixel>>(layout));
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
      const Outcome<Pixel>& outcome = *outcomes[frame];
      EXPECT_EQ(std::ranges::count(outcome.owners, 1), static_cast<std::ptrdiff_t>(tiles.size()));
      EXPECT_EQ(outcome.astray, 0U);
      const auto expected = test::serial_over<Pixel>(test::random_order(ranks_, frame), layout, frame);
      EXPECT_LE(largest_difference<Pixel>(outcome.frame, expected, tiles), allowed<Pixel>(ranks_per_host));
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
                         testing::Combine(testing::ValuesIn(every_blender()),
                                          testing::Values(1, 2, 3, 4, 5, 6, 7, 8, 9, 16, 17)),
                         case_name);

/// One thin layer over another over ... in doubles, whose own error is 2^-29 of what is measured.
std::vector<std::array<double, 4>> exact_over(std::span<const int> order, const FrameLayout& layout, bool bytes,
                                              std::uint64_t seed) {
  std::vector<std::array<double, 4>> result(layout.tiles() * kTilePixels);
  const auto blend = [&](const auto& pixels, double one) {
    for (std::size_t i = 0; i < result.size(); ++i) {
      auto& front = result[i];
      const double through = 1.0 - front[3] / one;
      front[0] += through * static_cast<double>(pixels[i].r);
      front[1] += through * static_cast<double>(pixels[i].g);
      front[2] += through * static_cast<double>(pixels[i].b);
      front[3] += through * static_cast<double>(pixels[i].a);
    }
  };
  for (const int rank : order) {
    if (bytes) {
      blend(test::pixels_of(test::random_colors<Rgba8Premultiplied>(rank, layout, seed)), 255.0);
    } else {
      blend(test::pixels_of(test::random_colors<RgbaPremultiplied>(rank, layout, seed)), 1.0);
    }
  }
  return result;
}

/// The largest distance from the exact result that any strategy reaches.
template <typename Pixel>
double largest_error(int ranks, std::uint64_t seed) {
  const FrameLayout layout({{200, 130}});
  const std::vector<int> order = test::random_order(ranks, seed);
  const auto exact = exact_over(order, layout, std::is_same_v<Pixel, Rgba8Premultiplied>, seed);
  double largest = 0.0;
  for (const std::string& name : every_blender()) {
    const std::vector<Pixel> frame = blended<Pixel>(name, {.size = ranks}, order, layout, seed);
    for (std::size_t i = 0; i < frame.size(); ++i) {
      const std::array<double, 4> have{static_cast<double>(frame[i].r), static_cast<double>(frame[i].g),
                                       static_cast<double>(frame[i].b), static_cast<double>(frame[i].a)};
      for (std::size_t c = 0; c < 4; ++c) largest = std::max(largest, std::abs(have[c] - exact[i][c]));
    }
  }
  return largest;
}

TEST(OverErrors, StayWithinTheirBoundAndComeNearEnoughForItToSaySomething) {
  for (int ranks = 2; ranks <= 9; ++ranks) {
    const double bytes = largest_error<Rgba8Premultiplied>(ranks, 1);
    EXPECT_LE(bytes, over_error_bound<Rgba8Premultiplied>(ranks)) << ranks;
    EXPECT_GE(bytes, over_error_bound<Rgba8Premultiplied>(ranks) / 8) << ranks;
    const double floats = largest_error<RgbaPremultiplied>(ranks, 2);
    EXPECT_LE(floats, over_error_bound<RgbaPremultiplied>(ranks)) << ranks;
    EXPECT_GE(floats, over_error_bound<RgbaPremultiplied>(ranks) / 50) << ranks;
  }
}

TEST(Blenders, BrightColorsKeepTheBoundTimesTheirBrightness) {
  constexpr float kBrightness = 1024.0F;
  constexpr int kRanks = 7;
  const FrameLayout layout({{100, 64}});
  const std::vector<std::size_t> tiles = all_tiles(layout);
  const std::vector<int> order = test::random_order(kRanks, 4);
  const auto bright = [&](int rank) {
    TileLayer<RgbaPremultiplied> layer = test::random_colors<RgbaPremultiplied>(rank, layout);
    for (RgbaPremultiplied& pixel : layer.run({0, layer.tiles()})) {
      pixel = {pixel.r * kBrightness, pixel.g * kBrightness, pixel.b * kBrightness, pixel.a};
    }
    return layer;
  };
  std::vector<RgbaPremultiplied> expected = test::pixels_of(bright(order.front()));
  for (std::size_t position = 1; position < order.size(); ++position) {
    const auto back = test::pixels_of(bright(order[position]));
    for (std::size_t i = 0; i < expected.size(); ++i) expected[i] = test::over_by_definition(expected[i], back[i]);
  }
  double largest = 0.0;
  for (const std::string& name : every_blender()) {
    Outcome<RgbaPremultiplied> outcome(layout);
    run_local_ranks(kRanks, [&](Communicator& comm) {
      TileLayer<RgbaPremultiplied> layer = bright(comm.rank());
      const Composited mine = make_blender<RgbaPremultiplied>(name)->blend(comm, layer, tiles, order, {});
      outcome.add(layer, mine, {}, comm.rank());
    });
    largest = std::max(largest, largest_difference<RgbaPremultiplied>(outcome.frame, expected, tiles));
  }
  const double bound = kAnyAssociation * kBrightness * over_error_bound<RgbaPremultiplied>(kRanks);
  EXPECT_LE(largest, bound);
  EXPECT_GT(largest, over_error_bound<RgbaPremultiplied>(kRanks));  // that of colours up to 1 would not do
}

TEST(Blenders, TheOrderOfArrivalChangesNoBit) {
  const FrameLayout layout({{200, 130}});
  const std::vector<int> order = test::random_order(6, 2);
  for (const std::string& name : every_blender()) {
    const auto once = blended<RgbaPremultiplied>(name, {.size = 6, .ranks_per_host = 2}, order, layout);
    for (std::uint64_t disorder = 1; disorder <= 8; ++disorder) {
      const LocalRanks ranks{.size = 6, .ranks_per_host = 2, .disorder = disorder};
      const auto again = blended<RgbaPremultiplied>(name, ranks, order, layout);
      EXPECT_EQ(std::memcmp(once.data(), again.data(), once.size() * sizeof once[0]), 0) << name << ' ' << disorder;
    }
  }
}

TEST(Blenders, RadixKWithOneFactorBlendsFrontToBackAndWithOthersWithinTheBound) {
  const FrameLayout layout({{200, 130}});
  const std::vector<std::size_t> tiles = all_tiles(layout);
  const std::vector<int> order = test::random_order(12, 9);
  const auto serial = test::serial_over<Rgba8Premultiplied>(order, layout);
  for (const char* name : {"radix-k:12", "radix-k:4,3", "radix-k:2,3,2"}) {
    EXPECT_TRUE(make_blender<Rgba8Premultiplied>(name)->fits(12));
    EXPECT_FALSE(make_blender<Rgba8Premultiplied>(name)->fits(8));
    const auto frame = blended<Rgba8Premultiplied>(name, {.size = 12, .disorder = 3}, order, layout);
    const double largest = largest_difference<Rgba8Premultiplied>(frame, serial, tiles);
    if (std::string_view(name) == "radix-k:12") {
      EXPECT_EQ(largest, 0.0);
    } else {
      EXPECT_LE(largest, kAnyAssociation * over_error_bound<Rgba8Premultiplied>(12)) << name;
      EXPECT_GT(largest, 0.0) << name;
    }
  }
}

TEST(Blenders, AllEqualTransparentOrOpaqueLayers) {
  const FrameLayout layout({{70, 70}});
  const std::vector<std::size_t> tiles = all_tiles(layout);
  const std::vector<int> order{2, 0, 4, 1, 3};
  for (const std::string& name : every_blender()) {
    for (const float alpha : {0.0F, 1.0F}) {
      run_local_ranks(5, [&](Communicator& comm) {
        TileLayer<RgbaPremultiplied> layer(layout);
        for (const std::size_t tile : tiles) {
          layer.set_active(tile);
          // Opaque: the frontmost alone is seen. Light without alpha: all of it adds up.
          const float light = alpha == 0.0F ? 1.0F : static_cast<float>(comm.rank());
          std::ranges::fill(layer.tile(tile), RgbaPremultiplied{light, light, light, alpha});
        }
        const Composited mine = make_blender<RgbaPremultiplied>(name)->blend(comm, layer, tiles, order, {});
        const float light = alpha == 0.0F ? 5.0F : 2.0F;
        for (const std::size_t tile : mine.tiles) {
          for (const RgbaPremultiplied pixel : layer.tile(tile)) {
            ASSERT_EQ(pixel, (RgbaPremultiplied{light, light, light, alpha})) << name;
          }
        }
      });
    }
  }
}

TEST(Blenders, WhatIsNoNumberStaysInItsPixel) {
  const FrameLayout layout({{70, 70}});
  const std::vector<std::size_t> tiles = all_tiles(layout);
  const std::vector<int> order{2, 0, 4, 1, 3};
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const std::string& name : every_blender()) {
    run_local_ranks(5, [&](Communicator& comm) {
      TileLayer<RgbaPremultiplied> layer(layout);
      for (const std::size_t tile : tiles) {
        layer.set_active(tile);
        std::ranges::fill(layer.tile(tile), RgbaPremultiplied{0.25F, 0.25F, 0.25F, 0.5F});
        if (comm.rank() == 4) layer.tile(tile)[7] = {nan, nan, nan, nan};
      }
      const Composited mine = make_blender<RgbaPremultiplied>(name)->blend(comm, layer, tiles, order, {});
      for (const std::size_t tile : mine.tiles) {
        for (std::size_t i = 0; i < kTilePixels; ++i) {
          ASSERT_EQ(std::isnan(layer.tile(tile)[i].g), i == 7) << name << ' ' << i;
        }
      }
    });
  }
}

TEST(Blenders, RefuseWhatIsNoOrderOfTheRanks) {
  const FrameLayout layout({{70, 70}});
  for (const std::string& name : every_blender()) {
    for (const std::vector<int>& order :
         std::vector<std::vector<int>>{{}, {0, 1}, {0, 1, 1}, {0, 1, 3}, {-1, 0, 1}, {0, 1, 2, 3}}) {
      run_local_ranks(3, [&](Communicator& comm) {
        TileLayer<Rgba8Premultiplied> layer(layout);
        try {
          (void)make_blender<Rgba8Premultiplied>(name)->blend(comm, layer, all_tiles(layout), order, {});
          ADD_FAILURE() << name << " took it";
        } catch (const Error& error) {
          EXPECT_EQ(error.code(), ExitCode::Internal);
        }
      });
    }
  }
}

TEST(Blenders, SharedMemorySendsNoPixelsWhereHostsHoldRunsOfTheOrder) {
  const FrameLayout layout({{512, 512}});
  const std::vector<std::size_t> tiles = all_tiles(layout);
  const auto bytes_sent = [&](int ranks_per_host, const std::vector<int>& order) {
    std::size_t bytes = 0;
    std::mutex mutex;
    run_local_ranks({.size = 4, .ranks_per_host = ranks_per_host}, [&](Communicator& comm) {
      CountingCommunicator counting(comm);
      TileLayer<Rgba8Premultiplied> layer(layout);
      for (const std::size_t tile : tiles) {
        layer.set_active(tile);
        std::ranges::fill(layer.tile(tile), Rgba8Premultiplied{1, 2, 3, 4});
      }
      (void)make_blender<Rgba8Premultiplied>("shared-memory")->blend(counting, layer, tiles, order, {});
      const std::lock_guard lock(mutex);
      bytes += counting.bytes_sent();
    });
    return bytes / (kTilePixels * sizeof(Rgba8Premultiplied));
  };
  EXPECT_EQ(bytes_sent(0, {3, 0, 2, 1}), 0U);        // tiles
  EXPECT_EQ(bytes_sent(2, {3, 2, 0, 1}), 64U);       // every tile once: half a frame each way
  EXPECT_EQ(bytes_sent(2, {3, 0, 2, 1}), 3U * 64U);  // to and fro between hosts: direct send
}

TEST(Blenders, PiecesGoStraightToTheirScreensWhereThoseShareTheWorkEvenly) {
  const FrameLayout layout({{256, 128}, {256, 128}, {256, 128}, {256, 128}});
  const std::vector<int> shown_by{2, 0, 3, 1};
  const std::vector<int> order{1, 3, 0, 2};
  for (const char* name : {"direct-send", "shared-memory"}) {
    run_local_ranks(4, [&](Communicator& comm) {
      TileLayer<Rgba8Premultiplied> layer(layout);
      for (const std::size_t tile : all_tiles(layout)) {
        layer.set_active(tile);
        std::ranges::fill(layer.tile(tile), Rgba8Premultiplied{1, 1, 1, 1});
      }
      const auto blender = make_blender<Rgba8Premultiplied>(name);
      const Composited mine = blender->blend(comm, layer, all_tiles(layout), order, shown_by);
      EXPECT_TRUE(mine.assembled) << name;
      EXPECT_EQ(mine.tiles.size(), 8U) << name;
      for (const std::size_t tile : mine.tiles) EXPECT_EQ(shown_by[layout.place(tile).screen], comm.rank()) << name;
    });
  }
}

TEST(Blenders, EmptyTilesCostABitAndScatteredPixelsWhatTheyHold) {
  const FrameLayout layout({{4096, 2048}});
  const std::vector<std::size_t> tiles = all_tiles(layout);
  run_local_ranks(2, [&](Communicator& comm) {
    CountingCommunicator counting(comm);
    TileLayer<Rgba8Premultiplied> layer(layout);
    if (comm.rank() == 1) {
      layer.set_active(77);
      for (std::size_t i = 0; i < 101; ++i) layer.tile(77)[i * 5] = {1, 2, 3, 4};
    }
    (void)make_blender<Rgba8Premultiplied>("serial")->blend(counting, layer, tiles, std::vector<int>{0, 1}, {});
    const std::size_t packed = 8 + 512 + 408;  // count, mask, 101 pixels up to a multiple of 8
    EXPECT_EQ(counting.bytes_sent(), comm.rank() == 1 ? 8 + 2048 / 8 + packed : 0U);
  });
}

TEST(MakeBlender, RefusesStrategiesThatKeepNoOrderByName) {
  for (const char* name : {"ring", "mpi-reduce", "auto"}) {
    try {
      (void)make_blender<Rgba8Premultiplied>(name);
      FAIL() << "expected an Error";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::Usage);
      EXPECT_EQ(error.what(), std::string("strategy '") + name +
                                  "' is none of those that keep the order of the layers, as `over` needs");
      EXPECT_EQ(error.hint(), "choices: serial, tree, binary-swap, radix-k, direct-send, shared-memory");
    }
  }
  EXPECT_THROW((void)make_blender<Rgba8Premultiplied>("binray-swap"), Error);
  EXPECT_THROW((void)make_blender<Rgba8Premultiplied>("radix-k:1"), Error);
}

TEST(MakeBlender, NamesAreThoseOfCompositors) {
  for (const std::string& name : every_blender()) {
    EXPECT_EQ(make_compositor(name)->name(), name);
    EXPECT_EQ(make_compositor(name)->merges_in_place(), make_blender<RgbaPremultiplied>(name)->merges_in_place());
  }
}

}  // namespace

}  // namespace hpr
