#include "walls/codecs/auto.h"

#include <gtest/gtest.h>

#include <array>

namespace hpr {
namespace {

/// A copy at 5 GB/s each way; 1 GB/s and 2 GB/s for a half; 200 MB/s and 400 MB/s for a fifth.
const std::array<CodecRate, 3> kRates{
    {{"raw", 0.2e-9, 0.2e-9, 1.0}, {"lz4", 1.0e-9, 0.5e-9, 0.5}, {"zstd", 5.0e-9, 2.5e-9, 0.2}}};

TEST(CodecChoice, CountsEncodingSendingAndDecoding) {
  EXPECT_DOUBLE_EQ(seconds_per_byte(kRates[1], {1e9, 1}), 1.0e-9 + 0.5e-9 + 0.5e-9);
  EXPECT_DOUBLE_EQ(seconds_per_byte(kRates[1], {1e9, 3}), 0.5e-9 + 0.5e-9);
}

TEST(CodecChoice, GoesFromRawToTheSmallestAsTheLinkGetsSlower) {
  EXPECT_EQ(choose_codec(kRates, {10e9, 1}), "raw");
  EXPECT_EQ(choose_codec(kRates, {200e6, 1}), "lz4");
  EXPECT_EQ(choose_codec(kRates, {12.5e6, 1}), "zstd");
}

TEST(CodecChoice, MoreCoresAffordASmallerPicture) {
  EXPECT_EQ(choose_codec(kRates, {100e6, 1}), "lz4");
  EXPECT_EQ(choose_codec(kRates, {100e6, 16}), "zstd");
}

TEST(CodecChoice, TheFirstOfEqualsStays) {
  const std::array<CodecRate, 2> equal{{{"a", 0, 0, 1.0}, {"b", 0, 0, 1.0}}};
  EXPECT_EQ(choose_codec(equal, {1e9, 1}), "a");
}

/// Half flat, half noise of few levels: compresses, but not to nothing.
Image<Rgba8> picture_of(std::uint32_t seed) {
  Image<Rgba8> picture({256, 128}, {40, 80, 120, 255});
  for (std::size_t i = 0; i < picture.pixels().size() / 2; ++i) {
    seed = seed * 1664525U + 1013904223U;
    picture.pixels()[i].g = static_cast<std::uint8_t>(100 + (seed >> 30U));
  }
  return picture;
}

std::string chosen_for(double bytes_per_second) {
  AutoCodec codec({.link_bytes_per_second = bytes_per_second});
  for (std::uint32_t frame = 0; frame < 6; ++frame) {
    EXPECT_EQ(codec.choice(), "");
    static_cast<void>(codec.encode(picture_of(frame)));
  }
  return std::string(codec.choice());
}

TEST(AutoCodec, TakesTheLinkIntoAccount) {
  EXPECT_EQ(chosen_for(1e15), "raw") << "no time is as short as that of copying";
  EXPECT_EQ(chosen_for(1e3), "zstd") << "only size counts";
}

TEST(AutoCodec, ChangesCodecsWithinAStreamUnseen) {
  for (const double bytes_per_second : {1e15, 1e3}) {
    const CodecSettings settings{.error = 2, .deltas = true, .link_bytes_per_second = bytes_per_second};
    const auto sender = make_codec("auto", settings);
    const auto receiver = make_codec("auto", settings);
    Image<Rgba8> picture = picture_of(1);
    for (int frame = 0; frame < 20; ++frame) {
      picture.at(3, frame).r = static_cast<std::uint8_t>(10 * frame);
      Image<Rgba8> arrived(picture.size());
      ASSERT_NO_THROW(receiver->decode(sender->encode(picture), arrived)) << frame;
      for (std::size_t i = 0; i < picture.pixels().size(); ++i) {
        ASSERT_LE(std::abs(picture.pixels()[i].r - arrived.pixels()[i].r), 2);
        ASSERT_LE(std::abs(picture.pixels()[i].g - arrived.pixels()[i].g), 2);
      }
    }
  }
}

}  // namespace
}  // namespace hpr
