#include <gtest/gtest.h>
#include <hwy/highway.h>

#include <functional>

#include "walls/codecs/coder.h"

namespace hpr {
namespace {

std::vector<Rgba8> noise(std::size_t count) {
  std::vector<Rgba8> pixels(count);
  std::uint32_t state = 5;
  for (Rgba8& pixel : pixels) {
    state = state * 1664525U + 1013904223U;
    pixel = from_word(state ^ (state >> 13U));
  }
  return pixels;
}

void on_every_instruction_set(const std::function<void()>& check) {
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    SCOPED_TRACE(hwy::TargetName(target));
    check();
  }
  hwy::SetSupportedTargetsForTest(0);
}

TEST(PixelPlanes, HoldDifferencesAndJoinToWhatTheyWere) {
  on_every_instruction_set([] {
    for (const std::size_t count : {0U, 1U, 2U, 16U, 17U, 18U, 33U, 1000U}) {
      const std::vector<Rgba8> pixels = noise(count);
      std::vector<std::uint8_t> planes(4 * count);
      split_planes(pixels, planes);
      for (std::size_t i = 0; i < count; ++i) {
        const Rgba8 p = pixels[i];
        const Rgba8 q = i > 0 ? pixels[i - 1] : Rgba8{};
        ASSERT_EQ(planes[i], ((p.r - p.g) - (q.r - q.g)) & 0xFF) << i;
        ASSERT_EQ(planes[count + i], (p.g - q.g) & 0xFF) << i;
        ASSERT_EQ(planes[2 * count + i], ((p.b - p.g) - (q.b - q.g)) & 0xFF) << i;
        ASSERT_EQ(planes[3 * count + i], (p.a - q.a) & 0xFF) << i;
      }
      std::vector<Rgba8> joined(count);
      join_planes(planes, joined);
      ASSERT_EQ(joined, pixels);
    }
  });
}

TEST(PixelPlanes, StepsLieWithinTheErrorForEveryLevel) {
  std::vector<Rgba8> levels(256);
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const auto level = static_cast<std::uint8_t>(i);
    levels[i] = {level, static_cast<std::uint8_t>(255 - level), level, level};
  }
  levels.push_back({9, 99, 199, 7});  // an odd count
  on_every_instruction_set([&] {
    for (int error = 1; error < 256; ++error) {
      std::vector<Rgba8> steps(levels.size());
      quantize(levels, error, steps);
      EXPECT_EQ(steps[255].r, (255 + error) / (2 * error + 1));
      dequantize(steps, error, steps);
      EXPECT_TRUE(all_within(levels, steps, error)) << error;
    }
  });
}

TEST(PixelPlanes, WithinSeesEveryByte) {
  on_every_instruction_set([] {
    for (const std::size_t count : {1U, 4U, 15U, 64U}) {
      const std::vector<Rgba8> a = noise(count);
      EXPECT_TRUE(all_within(a, a, 0));
      for (std::size_t i = 0; i < count; ++i) {
        std::vector<Rgba8> b = a;
        b[i].g = static_cast<std::uint8_t>(a[i].g < 128 ? a[i].g + 9 : a[i].g - 9);
        EXPECT_FALSE(all_within(a, b, 8));
        EXPECT_TRUE(all_within(a, b, 9));
        b[i].a ^= 1U;
        EXPECT_FALSE(all_within(a, b, 9)) << "alpha has no error";
      }
    }
  });
}

}  // namespace
}  // namespace hpr
