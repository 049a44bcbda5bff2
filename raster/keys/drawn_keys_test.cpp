#include "raster/keys/drawn_keys.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <vector>

namespace hpr {
namespace {

/// A key that tells where it came from; nothing in every third column block.
Key key_at(int x, int y) {
  if (x / 70 % 3 == 1) return kNoKey;
  return make_key(1.0F / static_cast<float>(1 + x + 3 * y), static_cast<std::uint32_t>(1000 * y + x));
}

TEST(PackKeys, PutsEveryPixelWhereItBelongs) {
  for (const Rect& rect : {Rect{0, 0, 300, 170}, Rect{13, 7, 14, 8}, Rect{63, 64, 129, 169}, Rect{70, 0, 140, 170}}) {
    std::vector<float> depths;
    std::vector<std::uint32_t> words;
    for (int y = rect.y1 - 1; y >= rect.y0; --y) {
      for (int x = rect.x0; x < rect.x1; ++x) {
        depths.push_back(key_depth(key_at(x, y)));
        words.push_back(static_cast<std::uint32_t>(key_at(x, y)));
      }
    }
    TileLayer<Key> layer(FrameLayout({Size{64, 64}, Size{300, 170}}));
    pack_keys(std::array{DrawnKeys(KeyHalves{depths, words})}, rect, 1, layer, 3);
    for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
      const TilePlace position = layer.layout().place(tile);
      bool drawn = false;
      for (int y = position.pixels.y0; y < position.pixels.y1; ++y) {
        for (int x = position.pixels.x0; x < position.pixels.x1; ++x) {
          const bool inside = position.screen == 1 && x >= rect.x0 && x < rect.x1 && y >= rect.y0 && y < rect.y1;
          const Key expected = inside ? key_at(x, y) : kNoKey;
          ASSERT_EQ(layer.at(position.screen, x, y), expected) << x << ' ' << y;
          drawn = drawn || expected != kNoKey;
        }
      }
      EXPECT_EQ(layer.active(tile), drawn) << tile;
    }
  }
}

TEST(PackKeys, KeepsTheLargerKey) {
  TileLayer<Key> layer(FrameLayout({Size{4, 1}}));
  const Rect rect{0, 0, 4, 1};
  const auto word = [](std::uint32_t surface) { return ~surface; };
  const std::vector<float> first_depths{0.5F, 0.5F, 0.0F, 0.25F};
  const std::vector<std::uint32_t> first_words{word(7), word(7), 0, word(1)};
  const std::vector<float> second_depths{0.25F, 0.5F, 0.125F, 0.0F};
  const std::vector<std::uint32_t> second_words{word(1), word(3), word(9), 0};
  const DrawnKeys first = KeyHalves{first_depths, first_words};
  const DrawnKeys second = KeyHalves{second_depths, second_words};
  pack_keys(std::array{first}, rect, 0, layer, 1);
  pack_keys(std::array{second}, rect, 0, layer, 1);
  EXPECT_EQ(layer.at(0, 0, 0), make_key(0.5F, 7));
  EXPECT_EQ(layer.at(0, 1, 0), make_key(0.5F, 3));
  EXPECT_EQ(layer.at(0, 2, 0), make_key(0.125F, 9));
  EXPECT_EQ(layer.at(0, 3, 0), make_key(0.25F, 1));

  TileLayer<Key> at_once(layer.layout());
  pack_keys(std::array{first, second}, rect, 0, at_once, 1);
  EXPECT_TRUE(std::ranges::equal(at_once.tile(0), layer.tile(0)));
}

TEST(PackKeys, OfNothingLeavesTheTilesInactive) {
  TileLayer<Key> layer(FrameLayout({Size{100, 100}}));
  const std::vector<float> depths(10000, 0.0F);
  const std::vector<std::uint32_t> words(10000, 0);
  pack_keys(std::array{DrawnKeys(KeyHalves{depths, words})}, {0, 0, 100, 100}, 0, layer, 2);
  pack_keys(std::array{DrawnKeys(KeyHalves{})}, {5, 5, 5, 9}, 0, layer, 2);
  EXPECT_EQ(layer.active_tiles(), 0U);
}

}  // namespace

}  // namespace hpr
