#include "compositing/sparse.h"

#include <gtest/gtest.h>
#include <hwy/highway.h>

#include <random>
#include <vector>

namespace hpr {
namespace {

using Tile = std::vector<Key>;

Tile random_tile(std::mt19937_64& random, unsigned percent) {
  Tile tile(kTilePixels);
  for (Key& key : tile) key = random() % 100 < percent ? random() : kNoKey;
  return tile;
}

std::span<const Key, kTilePixels> view(const Tile& tile) {
  return std::span(tile).first<kTilePixels>();
}

/// Once for each instruction set this machine has, and with none.
template <typename Check>
void on_every_instruction_set(Check check) {
  for (std::int64_t set : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(set);
    SCOPED_TRACE(hwy::TargetName(set));
    check();
  }
  hwy::SetSupportedTargetsForTest(0);
}

TEST(Sparse, PackingKeepsTheDrawnPixelsInOrder) {
  std::mt19937_64 random(1);
  for (const unsigned percent : {0U, 1U, 10U, 50U, 99U, 100U}) {
    const Tile tile = random_tile(random, percent);
    std::vector<Key> expected;
    for (const Key key : tile) {
      if (key != kNoKey) expected.push_back(key);
    }
    on_every_instruction_set([&] {
      TileMask mask;
      EXPECT_EQ(find_drawn(view(tile), mask), expected.size());
      for (std::size_t i = 0; i < kTilePixels; ++i) EXPECT_EQ(mask.at(i / 64) >> (i % 64) & 1U, tile[i] != kNoKey);
      std::vector<Key> packed(kTilePixels);
      EXPECT_EQ(pack_drawn(view(tile), mask, packed.data()), expected.size());
      packed.resize(expected.size());
      EXPECT_EQ(packed, expected);
    });
  }
}

TEST(Sparse, MergingPackedPixelsIsThePixelwiseMaximum) {
  std::mt19937_64 random(2);
  for (const unsigned percent : {0U, 1U, 10U, 50U, 99U, 100U}) {
    const Tile from = random_tile(random, percent);
    const Tile before = random_tile(random, 60);
    Tile expected(kTilePixels);
    for (std::size_t i = 0; i < kTilePixels; ++i) expected[i] = std::max(from[i], before[i]);
    on_every_instruction_set([&] {
      TileMask mask;
      std::vector<Key> packed(kTilePixels);
      find_drawn(view(from), mask);
      packed.resize(pack_drawn(view(from), mask, packed.data()));
      packed.shrink_to_fit();  // reading past the last would be seen by the address sanitizer
      Tile into = before;
      merge_packed(std::span(into).first<kTilePixels>(), mask, packed);
      EXPECT_EQ(into, expected);
    });
  }
}

template <typename Pixel>
class SparseColors : public testing::Test {};
using PixelTypes = testing::Types<Rgba8Premultiplied, RgbaPremultiplied>;
TYPED_TEST_SUITE(SparseColors, PixelTypes);

TYPED_TEST(SparseColors, PackingAndUnpackingGivesTheTileBack) {
  std::mt19937_64 random(3);
  using Channel = decltype(TypeParam::a);
  for (const unsigned percent : {0U, 1U, 50U, 100U}) {
    std::vector<TypeParam> tile(kTilePixels);
    std::size_t drawn = 0;
    for (TypeParam& pixel : tile) {
      if (random() % 100 >= percent) continue;
      // One channel is enough, whichever it is.
      const auto value = static_cast<Channel>(1 + random() % 200);
      const auto which = random() % 4;
      pixel = {which == 0 ? value : Channel{}, which == 1 ? value : Channel{}, which == 2 ? value : Channel{},
               which == 3 ? value : Channel{}};
      ++drawn;
    }
    const auto whole = std::span<const TypeParam>(tile).template first<kTilePixels>();
    on_every_instruction_set([&] {
      TileMask mask;
      ASSERT_EQ(find_drawn(whole, mask), drawn);
      std::vector<TypeParam> packed(kTilePixels);
      ASSERT_EQ(pack_drawn(whole, mask, packed.data()), drawn);
      packed.resize(drawn);
      packed.shrink_to_fit();  // reading past the last would be seen by the address sanitizer
      std::vector<TypeParam> back(kTilePixels);
      const TypeParam guard{7, 7, 7, 7};  // pixels that are not drawn stay
      for (std::size_t i = 0; i < kTilePixels; ++i) back[i] = tile[i] == TypeParam{} ? guard : TypeParam{};
      unpack_drawn(std::span<const TypeParam>(packed), mask, std::span(back).template first<kTilePixels>());
      for (std::size_t i = 0; i < kTilePixels; ++i) ASSERT_EQ(back[i], tile[i] == TypeParam{} ? guard : tile[i]) << i;
    });
  }
}

}  // namespace
}  // namespace hpr
