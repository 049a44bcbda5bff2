#include <gtest/gtest.h>
#include <mpi.h>

#include <algorithm>
#include <vector>

#include "cluster/mpi_communicator.h"
#include "compositing/assembly.h"
#include "compositing/compositor.h"
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
  const std::vector<std::size_t> tiles = test::all_tiles(layout);
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
  const std::vector<std::size_t> tiles = test::all_tiles(layout);
  const std::vector<int> shown_by{comm.size() - 1, 0};
  const auto memory = comm.share(TileLayer<Key>::bytes_for(layout));
  for (const auto& compositor : all_compositors()) {
    for (std::uint64_t frame = 1; frame <= 3; ++frame) {
      TileLayer<Key> layer(layout, memory);
      layer.clear();
      test::copy_layer(test::random_layer(comm.rank(), layout, frame), layer);
      const Composited mine = compositor->composite(comm, layer, tiles, shown_by);
      if (!mine.assembled) Assembler().assemble(comm, layer, mine.tiles, shown_by);
      const std::vector<std::size_t> shown = tiles_shown(layout, shown_by, comm.rank());
      EXPECT_EQ(wrong_tiles(layer, shown, test::expected_keys(comm.size(), layout, frame)), 0U) << compositor->name();
    }
  }
}

}  // namespace
}  // namespace hpr
