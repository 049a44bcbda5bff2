#include "walls/codec.h"

#include <gtest/gtest.h>

#include "core/error.h"

namespace hpr {
namespace {

/// Flat parts, a gradient, noise and alpha: what real frames hold.
Image<Rgba8> frame_like(Size size, std::uint32_t seed) {
  Image<Rgba8> picture(size, {30, 30, 40, 255});
  std::uint32_t state = seed * 2654435761U + 1;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      state = state * 1664525U + 1013904223U;
      const auto noise = static_cast<std::uint8_t>(state >> 24U);
      if (x * 3 < size.width) continue;
      if (x * 3 < size.width * 2) {
        picture.at(x, y) = {static_cast<std::uint8_t>(x), static_cast<std::uint8_t>(y * 2),
                            static_cast<std::uint8_t>(x + y + noise % 3), 255};
      } else {
        picture.at(x, y) = {noise, static_cast<std::uint8_t>(state >> 16U), static_cast<std::uint8_t>(state >> 8U),
                            static_cast<std::uint8_t>(y % 2 == 0 ? 255 : state >> 12U)};
      }
    }
  }
  return picture;
}

class CodecTest : public ::testing::TestWithParam<std::string> {};

INSTANTIATE_TEST_SUITE_P(All, CodecTest, ::testing::ValuesIn(all_codecs()),
                         [](const auto& test) { return test.param; });

TEST_P(CodecTest, ReturnsPicturesOfAnySize) {
  for (const Size size : {Size{0, 0}, Size{1, 1}, Size{3, 1}, Size{1, 70}, Size{63, 65}, Size{200, 130}}) {
    const auto sender = make_codec(GetParam(), {});
    const auto receiver = make_codec(GetParam(), {});
    EXPECT_EQ(sender->name(), GetParam());
    const Image<Rgba8> picture = frame_like(size, 1);
    Image<Rgba8> arrived(size);
    receiver->decode(sender->encode(picture), arrived);
    if (GetParam() != "jpeg") {
      EXPECT_EQ(arrived, picture) << size.width;
    }
  }
}

TEST_P(CodecTest, EveryFlippedBitAndEveryCutIsFound) {
  const Image<Rgba8> picture = frame_like({160, 90}, 2);
  const std::vector<std::byte> good = make_codec(GetParam(), {})->encode(picture);
  const auto receiver = make_codec(GetParam(), {});
  Image<Rgba8> arrived(picture.size());
  std::uint64_t state = 7;
  for (int i = 0; i < 1000; ++i) {
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    std::vector<std::byte> bad = good;
    const std::size_t bit = (state >> 20U) % (good.size() * 8);
    if (i % 10 == 0) {
      bad.resize(bit / 8);
    } else {
      bad[bit / 8] ^= std::byte{1} << (bit % 8);
    }
    EXPECT_THROW(receiver->decode(bad, arrived), Error) << i;
    EXPECT_EQ(arrived.size(), picture.size());
  }
  EXPECT_NO_THROW(receiver->decode(good, arrived));
}

TEST(Codecs, UnknownNamesListTheChoicesAndSettingsHaveRanges) {
  try {
    static_cast<void>(make_codec("row", {}));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Usage);
    EXPECT_NE(error.hint().find("did you mean 'raw'?"), std::string::npos);
  }
  EXPECT_THROW(static_cast<void>(make_codec("raw", {.quality = 0})), Error);
  EXPECT_THROW(static_cast<void>(make_codec("raw", {.error = 256})), Error);
}

TEST(Codecs, APictureOfAnotherSizeIsRefused) {
  const auto codec = make_codec("raw", {});
  Image<Rgba8> arrived({4, 3});
  EXPECT_THROW(codec->decode(codec->encode(frame_like({3, 4}, 1)), arrived), Error);
}

}  // namespace
}  // namespace hpr
