#include "core/units.h"

#include <gtest/gtest.h>

namespace hpr {
namespace {

using std::chrono::nanoseconds;

TEST(Units, BytesTakeBinaryAndDecimalUnits) {
  EXPECT_EQ(parse_bytes("0"), 0U);
  EXPECT_EQ(parse_bytes("512"), 512U);
  EXPECT_EQ(parse_bytes("512B"), 512U);
  EXPECT_EQ(parse_bytes("64KiB"), 65536U);
  EXPECT_EQ(parse_bytes("64K"), 65536U);
  EXPECT_EQ(parse_bytes("64kB"), 64000U);
  EXPECT_EQ(parse_bytes("1.5GB"), 1'500'000'000U);
  EXPECT_EQ(parse_bytes("2G"), std::uint64_t{2} << 30U);
  EXPECT_EQ(parse_bytes("1 TiB"), std::uint64_t{1} << 40U);
}

TEST(Units, BytesRefuseWhatIsNoSize) {
  for (const char* text :
       {"", "GB", "-1", "1X", "1GBB", "nan", "inf", "1e400", "1e30", "9000000TiB", "0x10", " 1", "+1"}) {
    EXPECT_EQ(parse_bytes(text), std::nullopt) << text;
  }
}

TEST(Units, BytesAreWrittenInAFittingUnitAndReadBack) {
  EXPECT_EQ(format_bytes(0), "0 B");
  EXPECT_EQ(format_bytes(1023), "1023 B");
  EXPECT_EQ(format_bytes(1024), "1 KiB");
  EXPECT_EQ(format_bytes(294912), "288 KiB");
  EXPECT_EQ(format_bytes((1U << 20U) - 1), "1 MiB");
  EXPECT_EQ(format_bytes(std::uint64_t{3} << 29U), "1.5 GiB");
  EXPECT_EQ(format_bytes(UINT64_MAX), "16 EiB");
  EXPECT_EQ(parse_bytes(format_bytes(std::uint64_t{5} << 39U)), std::uint64_t{5} << 39U);
}

TEST(Units, DurationsTakeUnitsAndBareSeconds) {
  EXPECT_EQ(parse_duration("2us"), nanoseconds(2000));
  EXPECT_EQ(parse_duration("33ms"), nanoseconds(33'000'000));
  EXPECT_EQ(parse_duration("1.5s"), nanoseconds(1'500'000'000));
  EXPECT_EQ(parse_duration("2min"), nanoseconds(120'000'000'000));
  EXPECT_EQ(parse_duration("3"), nanoseconds(3'000'000'000));
  for (const char* text : {"", "s", "-1s", "1h2", "nan", "1e20"}) EXPECT_EQ(parse_duration(text), std::nullopt) << text;
}

TEST(Units, ExtentsAreTwoPositiveIntegers) {
  EXPECT_EQ(parse_extent("1920x1080"), (std::pair{1920, 1080}));
  EXPECT_EQ(parse_extent("1x1"), (std::pair{1, 1}));
  for (const char* text : {"", "x", "1x", "x1", "0x1", "1x0", "-1x2", "1x-2", "1X2", "1x2x3", "1x2 ", " 1x2", "1.5x2",
                           "99999999999x1", "1x99999999999"}) {
    EXPECT_EQ(parse_extent(text), std::nullopt) << text;
  }
}

}  // namespace
}  // namespace hpr
