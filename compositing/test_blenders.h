#pragma once

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
#include "compositing/blender.h"
#include "compositing/over.h"
#include "compositing/test_layers.h"
#include "compositing/test_over.h"
#include "core/error.h"

/// Running blenders on threads, and comparing what they leave.
namespace hpr::test {

inline constexpr double kAnyAssociation = 2.0;  // bounds against the exact result hold twice between two associations

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
    TileLayer<Pixel> layer = random_colors<Pixel>(comm.rank(), layout, seed);
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
      largest = std::max(largest, difference(a[i], b[i]));
    }
  }
  return largest;
}

inline std::vector<std::string> every_blender() {
  std::vector<std::string> names;
  for (const auto& blender : all_blenders<RgbaPremultiplied>()) names.emplace_back(blender->name());
  return names;
}

}  // namespace hpr::test
