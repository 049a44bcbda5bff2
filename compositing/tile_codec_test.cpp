#include "compositing/tile_codec.h"

#include <gtest/gtest.h>

#include <random>

#include "compositing/test_layers.h"
#include "core/error.h"

namespace hpr {
namespace {

const FrameLayout kLayout({{200, 130}, {64, 1}});

/// Runs `decode`; true when it refuses with Error (Internal).
template <typename Decode>
bool refused(Decode decode) {
  try {
    decode();
    return false;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Internal);
    return true;
  }
}

TEST(TileCodec, DecodingGivesBackTheTilesAndEmptiesThoseThatWereEmpty) {
  const TileLayer<Key> sent = test::random_layer(0, kLayout);
  const std::vector<std::size_t> tiles{0, 2, 3, 7, 11, 12};
  TileLayer<Key> layer = test::random_layer(1, kLayout);
  decode_tiles(layer, std::span(tiles), encode_tiles(sent, std::span(tiles)));
  const TileLayer<Key> other = test::random_layer(1, kLayout);
  for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
    const TileLayer<Key>& expected = std::ranges::binary_search(tiles, tile) ? sent : other;
    EXPECT_EQ(layer.active(tile), expected.active(tile)) << tile;
    EXPECT_TRUE(std::ranges::equal(layer.tile(tile), expected.tile(tile))) << tile;
  }
}

TEST(TileCodec, MergingTakesTheLargerKeyOfEveryPixel) {
  const std::vector<std::size_t> tiles = test::all_tiles(kLayout);
  TileLayer<Key> layer = test::random_layer(0, kLayout);
  merge_encoded(layer, tiles, encode_tiles(test::random_layer(1, kLayout), std::span(tiles)));
  EXPECT_EQ(test::keys_of(layer), test::expected_keys(2, kLayout));
}

TEST(TileCodec, AnEmptyTileTakesOneBitAndAnEmptyListOneWord) {
  const TileLayer<Key> layer(FrameLayout({{64 * 65, 64}}));
  const std::vector<std::size_t> tiles = test::all_tiles(layer.layout());
  EXPECT_EQ(encode_tiles(layer, std::span(tiles)).size(), 8U + 2 * 8U);
  EXPECT_EQ(encode_tiles(layer, std::span(tiles).first(64)).size(), 8U + 8U);
  EXPECT_EQ(encode_tiles(layer, std::span(tiles).first(0)).size(), 8U);
}

TEST(TileCodec, EveryTruncatedOrLengthenedMessageIsRefused) {
  const std::vector<std::size_t> tiles = test::all_tiles(kLayout);
  const std::vector<std::byte> whole = encode_tiles(test::random_layer(0, kLayout), std::span(tiles));
  std::mt19937_64 random(1);
  for (int i = 0; i < 400; ++i) {
    const std::size_t size = i < 40 ? static_cast<std::size_t>(i) : random() % whole.size();
    const std::vector<std::byte> cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    TileLayer<Key> layer(kLayout);
    EXPECT_TRUE(refused([&] { merge_encoded(layer, tiles, cut); })) << size;
    EXPECT_TRUE(refused([&] { decode_tiles(layer, std::span(tiles), cut); })) << size;
    EXPECT_EQ(layer.active_tiles(), 0U);  // refused before anything was written
  }
  std::vector<std::byte> longer = whole;
  longer.push_back(std::byte{0});
  TileLayer<Key> layer(kLayout);
  EXPECT_TRUE(refused([&] { merge_encoded(layer, tiles, longer); }));
}

TEST(TileCodec, FlippedHeadBitsAreRefusedAndFlippedPixelBitsAreOnlyPixels) {
  const std::vector<std::size_t> tiles = test::all_tiles(kLayout);
  const std::vector<std::byte> whole = encode_tiles(test::random_layer(0, kLayout), std::span(tiles));
  for (std::size_t bit = 0; bit < 16 * 8 + 64; ++bit) {
    std::vector<std::byte> flipped = whole;
    flipped[bit / 8] ^= std::byte{1} << (bit % 8);
    TileLayer<Key> layer(kLayout);
    EXPECT_EQ(refused([&] { merge_encoded(layer, tiles, flipped); }), bit < 16 * 8) << bit;
  }
}

TEST(TileCodec, RandomBytesNeverCrash) {
  std::mt19937_64 random(2);
  const std::vector<std::size_t> tiles{0, 1, 2};
  for (int i = 0; i < 2000; ++i) {
    std::vector<std::byte> bytes(random() % 64);
    for (std::byte& byte : bytes) byte = static_cast<std::byte>(random() % 3);
    TileLayer<Key> layer(kLayout);
    const bool valid_head = bytes.size() == 16 && std::ranges::all_of(bytes, [](auto b) { return b == std::byte{0}; });
    EXPECT_EQ(refused([&] { merge_encoded(layer, tiles, bytes); }), !valid_head);
  }
}

}  // namespace
}  // namespace hpr
