#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <span>
#include <type_traits>
#include <vector>

#include "image/color.h"
#include "image/key.h"
#include "image/tiles.h"

namespace hpr::test {

/// Layers for tests: the same for a rank, layout and seed wherever they are made.

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
    const Rect rect = layout.place(tile).pixels;
    for (int y = 0; y < rect.height(); ++y) {
      for (int x = 0; x < rect.width(); ++x) {
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

/// Translucent layers for tests, and what blending them must give: written without the kernels, pixel by pixel.

/// One channel by the definition, in whole numbers: no channel is ever half way between two levels.
inline std::uint8_t over_by_definition(int front, int alpha, int back) {
  const int behind = (2 * (255 - alpha) * back + 255) / 510;
  return static_cast<std::uint8_t>(std::min(front + behind, 255));
}

inline Rgba8Premultiplied over_by_definition(Rgba8Premultiplied front, Rgba8Premultiplied back) {
  const auto channel = [&](int f, int b) { return over_by_definition(f, front.a, b); };
  return {channel(front.r, back.r), channel(front.g, back.g), channel(front.b, back.b), channel(front.a, back.a)};
}

/// Three roundings a channel.
inline RgbaPremultiplied over_by_definition(RgbaPremultiplied front, RgbaPremultiplied back) {
  const RgbaPremultiplied none;
  if (std::memcmp(&front, &none, sizeof none) == 0) return back;
  if (std::memcmp(&back, &none, sizeof none) == 0) return front;
  const float through = 1.0F - front.a;
  const auto channel = [&](float f, float b) {
    const float behind = through * b;
    return f + behind;
  };
  return {channel(front.r, back.r), channel(front.g, back.g), channel(front.b, back.b), channel(front.a, back.a)};
}

/// Premultiplied: no channel past alpha. Opaque and transparent ones among them.
template <typename Pixel>
Pixel random_color(std::mt19937_64& random) {
  using Channel = decltype(Pixel::a);
  constexpr bool kBytes = std::is_same_v<Channel, std::uint8_t>;
  const auto up_to = [&](Channel most) {
    if constexpr (kBytes) return static_cast<Channel>(random() % (most + 1U));
    return static_cast<Channel>(static_cast<float>(random() % 16777217U) * 0x1p-24F * static_cast<float>(most));
  };
  const Channel one = kBytes ? 255 : 1;
  // Mostly thin, or a few layers would hide the others and their rounding.
  const auto pick = random() % 16;
  const auto thin = static_cast<Channel>(kBytes ? 40 : 0.15F);
  const Channel a = pick == 0 ? Channel{0} : pick == 1 ? one : up_to(pick < 12 ? thin : one);
  return {up_to(a), up_to(a), up_to(a), a};
}

/// About a third of the tiles is empty, and a fraction of the pixels of the others that differs from tile to tile.
template <typename Pixel>
TileLayer<Pixel> random_colors(int rank, const FrameLayout& layout, std::uint64_t seed = 1) {
  std::mt19937_64 random(seed * 1000 + static_cast<std::uint64_t>(rank) + 77);
  TileLayer<Pixel> layer(layout);
  for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
    if (random() % 3 == 0) continue;
    layer.set_active(tile);
    const std::uint64_t drawn = std::array<std::uint64_t, 4>{1, 30, 90, 100}.at(random() % 4);  // percent
    const Rect rect = layout.place(tile).pixels;
    for (int y = 0; y < rect.height(); ++y) {
      for (int x = 0; x < rect.width(); ++x) {
        if (random() % 100 >= drawn) continue;
        layer.tile(tile)[static_cast<std::size_t>(y) * kTileSide + static_cast<std::size_t>(x)] =
            random_color<Pixel>(random);
      }
    }
  }
  return layer;
}

/// All pixels of a frame, tile after tile.
template <typename Pixel>
std::vector<Pixel> pixels_of(const TileLayer<Pixel>& layer) {
  const auto pixels = layer.run({0, layer.tiles()});
  return {pixels.begin(), pixels.end()};
}

/// Front to back: ((a over b) over c) over ...
template <typename Pixel>
std::vector<Pixel> serial_over(std::span<const int> order, const FrameLayout& layout, std::uint64_t seed = 1) {
  std::vector<Pixel> result = pixels_of(random_colors<Pixel>(order.front(), layout, seed));
  for (const int rank : order.subspan(1)) {
    const std::vector<Pixel> back = pixels_of(random_colors<Pixel>(rank, layout, seed));
    for (std::size_t i = 0; i < result.size(); ++i) result[i] = over_by_definition(result[i], back[i]);
  }
  return result;
}

/// The largest difference in a channel; infinite where one is no number.
template <typename Pixel>
double difference(Pixel a, Pixel b) {
  const auto channel = [](auto x, auto y) {
    const double apart = std::abs(static_cast<double>(x) - static_cast<double>(y));
    return std::isnan(apart) ? HUGE_VAL : apart;
  };
  return std::max({channel(a.r, b.r), channel(a.g, b.g), channel(a.b, b.b), channel(a.a, b.a)});
}

inline std::vector<int> random_order(int ranks, std::uint64_t seed) {
  std::vector<int> order(static_cast<std::size_t>(ranks));
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
  std::mt19937_64 random(seed);
  std::ranges::shuffle(order, random);
  return order;
}

}  // namespace hpr::test
