#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <random>
#include <span>
#include <vector>

#include "image/key.h"
#include "image/tiles.h"

/// Layers for tests: the same for a rank, layout and seed wherever they are made.
namespace hpr::test {

/// A depth that is awkward for a comparison of floats or of half a key: zero, denormal, equal to others', near.
inline float awkward_depth(std::mt19937_64& random) {
  constexpr std::array<float, 6> kAwkward{
      0.0F, std::numeric_limits<float>::denorm_min(), std::numeric_limits<float>::min(), 0.5F, 0.50000006F, 1.0F};
  if (random() % 2 == 0) return kAwkward.at(random() % kAwkward.size());
  return static_cast<float>(random() % 1000) / 1000.0F;
}

/// About a third of the tiles is empty, and about a third of the pixels of the others; surfaces collide between ranks.
inline TileLayer<Key> random_layer(int rank, const FrameLayout& layout, std::uint64_t seed = 1) {
  std::mt19937_64 random(seed * 1000 + static_cast<std::uint64_t>(rank));
  TileLayer<Key> layer(layout);
  for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
    if (random() % 3 == 0) continue;
    layer.set_active(tile);
    const Rect place = layout.place(tile).pixels;
    for (int y = 0; y < place.height(); ++y) {
      for (int x = 0; x < place.width(); ++x) {
        if (random() % 3 == 0) continue;
        const auto surface = static_cast<std::uint32_t>(random() % 5 == 0 ? random() % 0xFFFFFFFFU : random() % 4);
        layer.tile(tile)[static_cast<std::size_t>(y) * kTileSide + static_cast<std::size_t>(x)] =
            make_key(awkward_depth(random), surface);
      }
    }
  }
  return layer;
}

/// All keys of a frame, tile after tile.
inline std::vector<Key> keys_of(const TileLayer<Key>& layer) {
  const auto keys = layer.run({0, layer.tiles()});
  return {keys.begin(), keys.end()};
}

/// What compositing the layers of `ranks` ranks must give: written without the merge kernel, the oracle of all tests.
inline std::vector<Key> expected_keys(int ranks, const FrameLayout& layout, std::uint64_t seed = 1) {
  std::vector<Key> result(layout.tiles() * kTilePixels, kNoKey);
  for (int rank = 0; rank < ranks; ++rank) {
    const std::vector<Key> keys = keys_of(random_layer(rank, layout, seed));
    for (std::size_t i = 0; i < keys.size(); ++i) {
      if (keys[i] > result[i]) result[i] = keys[i];
    }
  }
  return result;
}

/// One case of tiles taking part: none, all, some.
struct TileList {
  FrameLayout layout;
  std::vector<std::size_t> tiles;
};

/// One pixel, odd sizes, exact tiles, several screens, fewer tiles than ranks, subsets with and without holes, nothing.
inline std::vector<TileList> awkward_tile_lists() {
  const FrameLayout pixel({{1, 1}});
  const FrameLayout odd({{333, 217}});
  const FrameLayout exact({{128, 64}, {64, 192}});
  const FrameLayout slim({{65, 1}, {1, 130}, {200, 70}});
  std::vector<TileList> lists;
  for (const FrameLayout& layout : {pixel, odd, exact, slim}) lists.push_back({layout, all_tiles(layout)});
  lists.push_back({odd, {}});
  lists.push_back({odd, {5, 6, 7, 8, 9, 10}});
  lists.push_back({slim, {1, 2, 4, 9, 12}});
  lists.push_back({exact, {3}});
  return lists;
}

}  // namespace hpr::test
