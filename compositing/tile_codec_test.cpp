#include "compositing/tile_codec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <random>
#include <utility>

#include "cluster/transport/local_communicator.h"
#include "compositing/kernels.h"
#include "compositing/test_layers.h"
#include "core/error.h"
#include "image/color.h"

namespace hpr {
namespace {

const FrameLayout kLayout({{200, 130}, {64, 1}});

/// Runs `parse`; true when it refuses with Error (Internal).
template <typename Parse>
bool refused(Parse parse) {
  try {
    parse();
    return false;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Internal);
    return true;
  }
}

/// Every tile drawn to another degree: nothing, one pixel, few, just packed, just whole, all.
TileLayer<Key> graded_layer(std::uint64_t seed) {
  constexpr std::array<std::size_t, 8> kDrawn{0, 1, 7, 63, 2000, kMaxPackedPixels, kMaxPackedPixels + 1, kTilePixels};
  std::mt19937_64 random(seed);
  TileLayer<Key> layer(kLayout);
  for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
    if (tile % 5 == 4) continue;
    layer.set_active(tile);
    std::vector<std::size_t> pixels(kTilePixels);
    std::iota(pixels.begin(), pixels.end(), std::size_t{0});
    std::ranges::shuffle(pixels, random);
    pixels.resize(kDrawn.at((tile + seed) % kDrawn.size()));
    for (const std::size_t pixel : pixels) layer.tile(tile)[pixel] = random() | 1U;
  }
  return layer;
}

/// Rank 1 sends `sent` to rank 0, where `read` gets it.
template <typename Pixel, typename Read>
void send(const TileLayer<Pixel>& sent, std::span<const std::size_t> tiles, Read read) {
  run_local_ranks(2, [&](Communicator& comm) {
    const int peer = 1;
    TileMessage message;
    if (comm.rank() == 1) {
      message.start();
      message.add(sent, tiles);
      const Outgoing out = message.to(0);
      comm.exchange({&out, 1}, {}, {});
    } else {
      comm.exchange({}, {&peer, 1}, [&](int from, std::span<const std::byte> arrived) { read(comm, from, arrived); });
    }
  });
}

std::vector<std::byte> head_of(const TileLayer<Key>& layer, std::span<const std::size_t> tiles) {
  TileMessage message;
  message.start();
  message.add(layer, tiles);
  return {message.head().begin(), message.head().end()};
}

TEST(TileCodec, ReplacingGivesTheSendersTilesAndEmptiesThoseThatWereEmpty) {
  const std::vector<std::size_t> tiles{0, 2, 3, 7, 8, 9, 11, 12};
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    const TileLayer<Key> sent = graded_layer(seed);
    TileLayer<Key> layer = test::random_layer(1, kLayout);
    send(sent, tiles,
         [&](Communicator& comm, int from, auto message) { TileReader().replace(comm, from, message, layer, tiles); });
    const TileLayer<Key> other = test::random_layer(1, kLayout);
    for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
      const TileLayer<Key>& expected = std::ranges::binary_search(tiles, tile) ? sent : other;
      EXPECT_EQ(layer.active(tile), expected.active(tile)) << tile;
      EXPECT_TRUE(std::ranges::equal(layer.tile(tile), expected.tile(tile))) << tile;
    }
  }
}

TEST(TileCodec, MergingTakesTheLargerKeyOfEveryPixel) {
  const std::vector<std::size_t> tiles = all_tiles(kLayout);
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    const TileLayer<Key> sent = graded_layer(seed);
    for (const bool empty : {false, true}) {
      TileLayer<Key> layer = empty ? TileLayer<Key>(kLayout) : graded_layer(seed + 3);
      std::vector<Key> expected = test::keys_of(layer);
      const std::vector<Key> arriving = test::keys_of(sent);
      for (std::size_t i = 0; i < expected.size(); ++i) expected[i] = std::max(expected[i], arriving[i]);
      send(sent, tiles,
           [&](Communicator& comm, int from, auto message) { TileReader().merge(comm, from, message, layer, tiles); });
      EXPECT_EQ(test::keys_of(layer), expected);
      for (std::size_t tile = 0; tile < layer.tiles(); ++tile) {
        EXPECT_TRUE(layer.active(tile) || std::ranges::count(layer.tile(tile), kNoKey) == kTilePixels);
      }
    }
  }
}

TEST(TileCodec, OtherPixelsTravelWhole) {
  const std::vector<std::size_t> tiles = all_tiles(kLayout);
  TileLayer<Rgb> sent(kLayout);
  sent.set_active(3);
  for (std::size_t i = 0; i < kTilePixels; ++i) sent.tile(3)[i] = {static_cast<float>(i), 2.0F, 3.0F};
  TileLayer<Rgb> layer(kLayout);
  layer.set_active(1);
  layer.tile(1)[5] = {1.0F, 1.0F, 1.0F};
  send(sent, tiles,
       [&](Communicator& comm, int from, auto message) { TileReader().replace(comm, from, message, layer, tiles); });
  EXPECT_EQ(layer.active_tiles(), 1U);
  EXPECT_EQ(layer.tile(1)[5].r, 0.0F);
  EXPECT_EQ(layer.tile(3)[4095].r, 4095.0F);
}

TEST(TileCodec, AnEmptyTileTakesOneBitAndAnEmptyListOneWord) {
  const TileLayer<Key> layer(FrameLayout({{64 * 65, 64}}));
  const std::vector<std::size_t> tiles = all_tiles(layer.layout());
  EXPECT_EQ(head_of(layer, std::span(tiles)).size(), 8U + 2 * 8U);
  EXPECT_EQ(head_of(layer, std::span(tiles).first(64)).size(), 8U + 8U);
  EXPECT_EQ(head_of(layer, std::span(tiles).first(0)).size(), 8U);
}

TEST(TileCodec, ScatteredPixelsCostABitOfTheirTileAndEightBytesEach) {
  for (const std::size_t drawn : {std::size_t{1}, std::size_t{500}, kMaxPackedPixels}) {
    TileLayer<Key> layer(FrameLayout({{64, 64}}));
    layer.set_active(0);
    for (std::size_t i = 0; i < drawn; ++i) layer.tile(0)[i * 5 % kTilePixels] = 7 + i;  // 5 and 4096 share no factor
    const std::vector<std::size_t> tiles{0};
    EXPECT_EQ(head_of(layer, tiles).size(), 8U + 8U + 8U + 512U + 8 * drawn);
  }
}

TEST(TileCodec, WholeNeighboursShareASegmentUpToItsSize) {
  std::vector<std::size_t> tiles(40);
  std::iota(tiles.begin(), tiles.end(), std::size_t{3});
  tiles[30] = 200;  // no neighbour of 32
  for (std::size_t i = 31; i < tiles.size(); ++i) tiles[i] = 170 + i;
  std::vector<std::uint16_t> drawn(tiles.size(), kWholeTile);
  drawn[2] = 9;
  drawn[3] = TileHead::kInactive;
  const std::vector<Segment> segments = segments_of(drawn, tiles);
  ASSERT_EQ(segments.size(), 4U);
  const std::vector<std::pair<std::size_t, std::size_t>> expected{{0, 2}, {4, 20}, {20, 30}, {30, 40}};
  for (std::size_t i = 0; i < segments.size(); ++i)
    EXPECT_EQ(std::pair(segments[i].first, segments[i].end), expected[i]);
}

TEST(TileCodec, EveryTruncatedOrLengthenedMessageIsRefused) {
  const std::vector<std::size_t> tiles = all_tiles(kLayout);
  const std::vector<std::byte> whole = head_of(graded_layer(0), tiles);
  std::mt19937_64 random(1);
  for (int i = 0; i < 400; ++i) {
    const std::size_t size = i < 40 ? static_cast<std::size_t>(i) : random() % whole.size();
    EXPECT_TRUE(refused([&] { (void)parse_head(std::span(whole).first(size), tiles.size(), true); })) << size;
  }
  std::vector<std::byte> longer = whole;
  longer.push_back(std::byte{0});
  EXPECT_TRUE(refused([&] { (void)parse_head(longer, tiles.size(), true); }));
  EXPECT_FALSE(refused([&] { (void)parse_head(whole, tiles.size(), true); }));
  EXPECT_TRUE(refused([&] { (void)parse_head(whole, tiles.size(), false); }));
}

TEST(TileCodec, EveryFlippedBitOfTheHeadAndTheMasksIsRefused) {
  TileLayer<Key> layer(FrameLayout({{192, 64}}));
  for (std::size_t tile = 0; tile < 2; ++tile) {
    layer.set_active(tile);
    for (std::size_t i = 0; i < 100; ++i) layer.tile(tile)[i * 7] = 5 + i;
  }
  const std::vector<std::size_t> tiles{0, 1, 2};
  const std::vector<std::byte> whole = head_of(layer, tiles);
  for (std::size_t bit = 0; bit < (24 + 512) * 8; ++bit) {
    if (bit >= 20 * 8 && bit < 24 * 8) continue;  // what fills up the counts is not looked at
    if (bit == 66) continue;                      // the third tile becomes active, with no pixels
    std::vector<std::byte> flipped = whole;
    flipped[bit / 8] ^= std::byte{1} << (bit % 8);
    EXPECT_TRUE(refused([&] { (void)parse_head(flipped, tiles.size(), true); })) << bit;
  }
}

TEST(TileCodec, RandomBytesNeverCrash) {
  std::mt19937_64 random(2);
  for (int i = 0; i < 5000; ++i) {
    std::vector<std::byte> bytes(random() % 96);
    for (std::byte& byte : bytes) byte = static_cast<std::byte>(random() % 4);
    if (bytes.size() >= 8 && random() % 2 == 0) std::memcpy(bytes.data(), &kTileFormat, sizeof kTileFormat);
    (void)refused([&] { (void)parse_head(bytes, 3, true); });
  }
}

}  // namespace
}  // namespace hpr
