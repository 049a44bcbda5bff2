#include "compositing/merge.h"

#include <gtest/gtest.h>
#include <hwy/highway.h>

#include <limits>
#include <numeric>
#include <random>
#include <vector>

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

}  // namespace
}  // namespace hpr
