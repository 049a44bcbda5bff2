#include <gtest/gtest.h>
#include <mpi.h>

#include <algorithm>
#include <vector>

#include "cluster/transport/mpi_communicator.h"
#include "compositing/assembly.h"
#include "compositing/compositor.h"
#include "compositing/kernels.h"
#include "compositing/test_layers.h"

// Run by ctest under mpiexec with 1 to 5 ranks. Every rank checks its own piece, so no gather can hide a fault.
// EXPECT, never ASSERT, between collectives: a rank that returns early leaves its peers waiting.
namespace hpr {
namespace {

std::size_t wrong_tiles(const TileLayer<Key>& layer, std::span<const std::size_t> tiles,
                        const std::vector<Key>& expected) {
  return static_cast<std::size_t>(std::ranges::count_if(tiles, [&](std::size_t tile) {
    return !std::ranges::equal(layer.tile(tile), std::span(expected).subspan(tile * kTilePixels, kTilePixels));
  }));
}

TEST(MpiCompositing, EveryStrategyHoldsTheSerialMaximum) {
  MpiCommunicator comm(MPI_COMM_WORLD);
  for (const auto& [layout, tiles] : test::awkward_tile_lists()) {
    const std::vector<Key> expected = test::expected_keys(comm.size(), layout);
    for (const auto& compositor : all_compositors()) {
      TileLayer<Key> layer = test::random_layer(comm.rank(), layout);
      const Composited mine = compositor->composite(comm, layer, tiles);
      EXPECT_EQ(wrong_tiles(layer, mine.tiles, expected), 0U) << compositor->name();
    }
  }
}

TEST(MpiCompositing, PiecesOfMegabytesReachSeveralScreens) {
  MpiCommunicator comm(MPI_COMM_WORLD);
  const FrameLayout layout({{700, 500}, {700, 500}, {333, 217}});
  const std::vector<std::size_t> tiles = all_tiles(layout);
  const std::vector<Key> expected = test::expected_keys(comm.size(), layout);
  const std::vector<int> shown_by{0, comm.size() - 1, comm.size() / 2};
  for (const auto& compositor : all_compositors()) {
    TileLayer<Key> layer = test::random_layer(comm.rank(), layout);
    const Composited mine = compositor->composite(comm, layer, tiles);
    Assembler().assemble(comm, layer, mine.tiles, shown_by);
    const std::vector<std::size_t> shown = tiles_shown(layout, shown_by, comm.rank());
    EXPECT_EQ(wrong_tiles(layer, shown, expected), 0U) << compositor->name();
  }
}

TEST(MpiCompositing, LayersInSharedMemoryAreMergedInPlaceFrameAfterFrame) {
  MpiCommunicator comm(MPI_COMM_WORLD);
  const FrameLayout layout({{700, 500}, {333, 217}});
  const std::vector<std::size_t> tiles = all_tiles(layout);
  const std::vector<int> shown_by{comm.size() - 1, 0};
  const auto memory = comm.share(TileLayer<Key>::bytes_for(layout));
  for (const auto& compositor : all_compositors()) {
    for (std::uint64_t frame = 1; frame <= 3; ++frame) {
      TileLayer<Key> layer(layout, memory);
      copy_tiles(test::random_layer(comm.rank(), layout, frame), layer, all_tiles(layout));
      const Composited mine = compositor->composite(comm, layer, tiles, shown_by);
      if (!mine.assembled) Assembler().assemble(comm, layer, mine.tiles, shown_by);
      const std::vector<std::size_t> shown = tiles_shown(layout, shown_by, comm.rank());
      EXPECT_EQ(wrong_tiles(layer, shown, test::expected_keys(comm.size(), layout, frame)), 0U) << compositor->name();
    }
  }
}

/// Tiles of which some channel is further from the serial result than two groupings may be; for strategies that blend
/// front to back, at all.
template <typename Pixel>
std::size_t tiles_past_the_bound(const TileLayer<Pixel>& layer, std::span<const std::size_t> tiles,
                                 const std::vector<Pixel>& expected, double bound) {
  return static_cast<std::size_t>(std::ranges::count_if(tiles, [&](std::size_t tile) {
    double largest = 0.0;
    for (std::size_t i = 0; i < kTilePixels; ++i) {
      largest = std::max(largest, test::difference(layer.tile(tile)[i], expected[tile * kTilePixels + i]));
    }
    return largest > bound;
  }));
}

template <typename Pixel>
void check_blenders(Communicator& comm) {
  std::uint64_t seed = 0;
  const auto blenders = all_blenders<Pixel>();
  for (const auto& [layout, tiles] : test::awkward_tile_lists()) {
    const std::vector<int> order = test::random_order(comm.size(), ++seed);
    const std::vector<Pixel> expected = test::serial_over<Pixel>(order, layout);
    for (const auto& blender : blenders) {
      const bool exact = blender->name() == "serial" || blender->name() == "direct-send";
      TileLayer<Pixel> layer = test::random_colors<Pixel>(comm.rank(), layout);
      const Composited mine = blender->blend(comm, layer, tiles, order, {});
      const double bound = exact ? 0.0 : 2.0 * over_error_bound<Pixel>(comm.size());
      EXPECT_EQ(tiles_past_the_bound(layer, mine.tiles, expected, bound), 0U) << blender->name();
    }
  }
}

TEST(MpiCompositing, EveryBlenderHoldsTheSerialResultWithinItsBound) {
  MpiCommunicator comm(MPI_COMM_WORLD);
  check_blenders<Rgba8Premultiplied>(comm);
  check_blenders<RgbaPremultiplied>(comm);
}

template <typename Pixel>
void check_blending_in_place(Communicator& comm) {
  const FrameLayout layout({{200, 130}, {333, 217}});
  const std::vector<std::size_t> tiles = all_tiles(layout);
  const std::vector<int> shown_by{comm.size() - 1, 0};
  const auto memory = comm.share(TileLayer<Pixel>::bytes_for(layout));
  for (const auto& blender : all_blenders<Pixel>()) {
    for (std::uint64_t frame = 1; frame <= 2; ++frame) {
      TileLayer<Pixel> layer(layout, memory);
      copy_tiles(test::random_colors<Pixel>(comm.rank(), layout, frame), layer, all_tiles(layout));
      const std::vector<int> order = test::random_order(comm.size(), frame);
      const Composited mine = blender->blend(comm, layer, tiles, order, shown_by);
      if (!mine.assembled) Assembler().assemble(comm, layer, mine.tiles, shown_by);
      const std::vector<std::size_t> shown = tiles_shown(layout, shown_by, comm.rank());
      const auto expected = test::serial_over<Pixel>(order, layout, frame);
      const double bound = 2.0 * over_error_bound<Pixel>(comm.size());
      EXPECT_EQ(tiles_past_the_bound(layer, shown, expected, bound), 0U) << blender->name();
    }
  }
}

TEST(MpiCompositing, TranslucentLayersInSharedMemoryReachTheirScreensInAnyOrder) {
  MpiCommunicator comm(MPI_COMM_WORLD);
  check_blending_in_place<Rgba8Premultiplied>(comm);
  check_blending_in_place<RgbaPremultiplied>(comm);
}

}  // namespace
}  // namespace hpr
