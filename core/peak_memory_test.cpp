#include "core/peak_memory.h"

#include <gtest/gtest.h>

#include <cstring>
#include <vector>

namespace hpr {
namespace {

constexpr std::uint64_t kMebibyte = 1024 * 1024;

/// Holds so much for a moment.
void touch(std::size_t bytes) {
  std::vector<char> memory(bytes);
  std::memset(memory.data(), 1, bytes);
  volatile char last = memory.back();
  (void)last;
}

TEST(PeakMemory, StaysAfterMemoryIsGivenBackAndBeginsAnewWhereTheSystemLetsIt) {
  const std::uint64_t before = peak_memory_bytes();
  EXPECT_GT(before, kMebibyte);
  touch(256 * kMebibyte);
  const std::uint64_t peak = peak_memory_bytes();
  EXPECT_GE(peak, 256 * kMebibyte);
  EXPECT_GE(peak_memory_bytes(), peak);
  if (!reset_peak_memory()) GTEST_SKIP() << "no /proc/self/clear_refs";
  EXPECT_LT(peak_memory_bytes(), peak - 128 * kMebibyte);
}

}  // namespace
}  // namespace hpr
