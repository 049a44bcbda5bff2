#include "compositing/kernels.h"

#include <gtest/gtest.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

#include "compositing/test_layers.h"

namespace hpr {
namespace {

TEST(MergeKeys, KeepsTheLargerKeyWhicheverSideItIsOn) {
  const Key near = make_key(0.75F, 7);
  const Key far = make_key(0.25F, 3);
  const Key far_lower_id = make_key(0.25F, 2);
  const Key denormal = make_key(std::numeric_limits<float>::denorm_min(), 0);
  const Key at_infinity = make_key(0.0F, 9);
  const Key top_bit = Key{1} << 63U;
  std::vector<Key> into{near, far, far, far_lower_id, kNoKey, at_infinity, denormal, kNoKey, top_bit, 5, 0x1FFFFFFFF};
  const std::vector<Key> from{far, near, far_lower_id, far, at_infinity, denormal, at_infinity, kNoKey,
                              1,   6,    0x200000000};
  const std::vector<Key> expected{near,    near, far_lower_id, far_lower_id, at_infinity, denormal, denormal, kNoKey,
                                  top_bit, 6,    0x200000000};
  merge_keys(into, from);
  EXPECT_EQ(into, expected);
}

TEST(MergeKeys, EverySizeAndAlignmentTouchesExactlyItsKeys) {
  constexpr Key kGuard = 0xABABABABABABABAB;
  for (std::size_t size = 0; size <= 130; ++size) {
    for (std::size_t offset = 0; offset < 8; ++offset) {
      std::vector<Key> into(size + 16, kGuard);
      std::vector<Key> from(size + 16, std::numeric_limits<Key>::max());
      const std::size_t from_offset = (offset * 3 + size) % 8;
      for (std::size_t i = 0; i < size; ++i) {
        into[offset + i] = i % 2 == 0 ? 1000 + i : i;
        from[from_offset + i] = i % 2 == 0 ? i : 1000 + i;
      }
      merge_keys(std::span(into).subspan(offset, size), std::span(from).subspan(from_offset, size));
      for (std::size_t i = 0; i < into.size(); ++i) {
        const bool inside = i >= offset && i < offset + size;
        ASSERT_EQ(into[i], inside ? 1000 + i - offset : kGuard) << "size " << size << " offset " << offset;
      }
    }
  }
}

TEST(MergeKeys, MergingALayerWithItselfChangesNothing) {
  std::vector<Key> keys(100);
  std::iota(keys.begin(), keys.end(), Key{1} << 40U);
  const std::vector<Key> before = keys;
  merge_keys(keys, keys);
  EXPECT_EQ(keys, before);
}

TEST(MergeKeys, EveryInstructionSetOfThisMachineGivesTheSameKeys) {
  std::mt19937_64 random(1);
  std::vector<Key> a(1027);
  std::vector<Key> b(1027);
  std::vector<Key> expected(1027);
  for (std::size_t i = 0; i < a.size(); ++i) {
    a[i] = random();
    b[i] = random() % 4 == 0 ? a[i] : random();
    expected[i] = a[i] > b[i] ? a[i] : b[i];
  }
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    std::vector<Key> into = a;
    merge_keys(into, b);
    EXPECT_EQ(into, expected) << hwy::TargetName(target);
  }
  hwy::SetSupportedTargetsForTest(0);
}

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

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

template <typename Pixel>
std::vector<Pixel> blended(const std::vector<Pixel>& front, const std::vector<Pixel>& back) {
  std::vector<Pixel> into(front.size());
  composite_over(std::span(front), std::span(back), std::span(into));
  return into;
}

template <typename Pixel>
bool same_bits(const std::vector<Pixel>& a, const std::vector<Pixel>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(Pixel)) == 0;
}

TEST(Over, ValuesByHand) {
  const std::vector<Rgba8Premultiplied> front{
      {100, 0, 7, 128}, {1, 2, 3, 255}, {0, 0, 0, 0}, {9, 9, 9, 9}, {0, 0, 0, 1}};
  const std::vector<Rgba8Premultiplied> back{
      {200, 255, 1, 255}, {9, 9, 9, 9}, {4, 5, 6, 7}, {0, 0, 0, 0}, {255, 127, 1, 255}};
  // 200 * 127 / 255 = 99.6, 255 * 127 / 255 = 127, 1 * 127 / 255 = 0.498; 127 * 254 / 255 = 126.502, 254 / 255 = 0.996.
  const std::vector<Rgba8Premultiplied> expected{
      {200, 127, 7, 255}, {1, 2, 3, 255}, {4, 5, 6, 7}, {9, 9, 9, 9}, {254, 127, 1, 255}};
  EXPECT_EQ(blended(front, back), expected);

  const std::vector<RgbaPremultiplied> near{{0.25F, 0.0F, 4.0F, 0.5F}, {0.5F, 0.25F, 0.0F, 1.0F}};
  const std::vector<RgbaPremultiplied> far{{0.5F, 1.0F, 8.0F, 1.0F}, {7.0F, 7.0F, 7.0F, 1.0F}};
  EXPECT_EQ(blended(near, far), (std::vector<RgbaPremultiplied>{{0.5F, 0.5F, 8.0F, 1.0F}, {0.5F, 0.25F, 0.0F, 1.0F}}));
}

TEST(Over, EveryPairOfBytesIsRoundedToNearestOnEveryInstructionSet) {
  std::vector<Rgba8Premultiplied> front;
  std::vector<Rgba8Premultiplied> back;
  std::vector<Rgba8Premultiplied> expected;
  for (unsigned alpha = 0; alpha < 256; ++alpha) {
    for (unsigned channel = 0; channel < 256; ++channel) {
      const auto a = static_cast<std::uint8_t>(alpha);
      const auto c = static_cast<std::uint8_t>(channel);
      const auto high = static_cast<std::uint8_t>(255 - channel);
      front.push_back({a, 0, high, a});
      back.push_back({c, c, high, c});
      expected.push_back(test::over_by_definition(front.back(), back.back()));
    }
  }
  on_every_instruction_set([&] { EXPECT_TRUE(blended(front, back) == expected); });
}

TEST(Over, FloatsAreTheDefinitionToTheBitOnEveryInstructionSet) {
  std::mt19937_64 random(1);
  const std::vector<float> awkward{0.0F,  -0.0F,       1.0F, std::numeric_limits<float>::denorm_min(),
                                   3e38F, 0.99999994F, 2.0F};
  const auto channel = [&] {
    return random() % 3 == 0 ? awkward[random() % awkward.size()] : static_cast<float>(random() % 1000003) / 1000003.0F;
  };
  std::vector<RgbaPremultiplied> front(1027);
  std::vector<RgbaPremultiplied> back(front.size());
  std::vector<RgbaPremultiplied> expected(front.size());
  for (std::size_t i = 0; i < front.size(); ++i) {
    if (random() % 5 != 0) front[i] = {channel(), channel(), channel(), channel()};
    if (random() % 5 != 0) back[i] = {channel(), channel(), channel(), channel()};
    expected[i] = test::over_by_definition(front[i], back[i]);
  }
  on_every_instruction_set([&] { EXPECT_TRUE(same_bits(blended(front, back), expected)); });
}

TEST(Over, TransparentPixelsChangeNoBitOnEitherSide) {
  const float infinity = std::numeric_limits<float>::infinity();
  const std::vector<RgbaPremultiplied> odd{
      {-0.0F, -0.0F, -0.0F, -0.0F}, {kNan, 0.5F, -0.0F, kNan}, {infinity, 1.0F, 2.0F, infinity}};
  const std::vector<RgbaPremultiplied> none(odd.size());
  on_every_instruction_set([&] {
    EXPECT_TRUE(same_bits(blended(odd, none), odd));
    EXPECT_TRUE(same_bits(blended(none, odd), odd));
  });
}

TEST(Over, WhatIsNoNumberStaysInItsPixel) {
  const std::vector<RgbaPremultiplied> front{
      {0.1F, 0.2F, 0.3F, 0.5F}, {kNan, 0.2F, 0.3F, 0.5F}, {0.1F, 0.2F, 0.3F, kNan}, {0.1F, 0.2F, 0.3F, 0.5F}};
  const std::vector<RgbaPremultiplied> back(front.size(), {0.5F, 0.5F, 0.5F, 1.0F});
  on_every_instruction_set([&] {
    const auto result = blended(front, back);
    EXPECT_EQ(result[0], result[3]);
    EXPECT_FALSE(std::isnan(result[0].r) || std::isnan(result[0].a));
    EXPECT_TRUE(std::isnan(result[1].r) && !std::isnan(result[1].g) && !std::isnan(result[1].a));
    EXPECT_TRUE(std::isnan(result[2].r) && std::isnan(result[2].a));
  });
}

template <typename Pixel>
class OverPixels : public testing::Test {};
using PixelTypes = testing::Types<Rgba8Premultiplied, RgbaPremultiplied>;
TYPED_TEST_SUITE(OverPixels, PixelTypes);

TYPED_TEST(OverPixels, EverySizeAndAlignmentTouchesExactlyItsPixelsAndMayBlendInPlace) {
  const TypeParam guard{7, 7, 7, 7};
  const TypeParam front{0, 1, 0, 0};
  const TypeParam back{1, 0, 0, 1};
  const TypeParam both{1, 1, 0, 1};
  on_every_instruction_set([&] {
    for (std::size_t size = 0; size <= 70; ++size) {
      const std::size_t offset = size % 5;
      for (const bool into_front : {false, true}) {
        std::vector<TypeParam> a(size + 16, into_front ? guard : front);
        std::vector<TypeParam> b(size + 16, into_front ? back : guard);
        std::vector<TypeParam>& into = into_front ? a : b;
        std::ranges::fill(std::span(into).subspan(offset, size), into_front ? front : back);
        const auto part_a = std::span(a).subspan(offset, size);
        const auto part_b = std::span(b).subspan(offset, size);
        composite_over(std::span<const TypeParam>(part_a), std::span<const TypeParam>(part_b),
                       into_front ? part_a : part_b);
        for (std::size_t i = 0; i < into.size(); ++i) {
          ASSERT_EQ(into[i], i >= offset && i < offset + size ? both : guard) << size << ": " << i;
        }
      }
    }
  });
}

}  // namespace

}  // namespace hpr
