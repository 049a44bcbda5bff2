#include "walls/codecs/codec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>

#include "core/error.h"
#include "walls/codecs/stream_codec.h"

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

/// The largest difference of r, g or b; 256 where alpha differs.
int largest_difference(const Image<Rgba8>& a, const Image<Rgba8>& b) {
  int largest = 0;
  for (std::size_t i = 0; i < a.pixels().size(); ++i) {
    const Rgba8 x = a.pixels()[i];
    const Rgba8 y = b.pixels()[i];
    if (x.a != y.a) return 256;
    largest = std::max({largest, std::abs(x.r - y.r), std::abs(x.g - y.g), std::abs(x.b - y.b)});
  }
  return largest;
}

/// The mean difference of r, g and b.
double mean_difference(const Image<Rgba8>& a, const Image<Rgba8>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.pixels().size(); ++i) {
    const Rgba8 x = a.pixels()[i];
    const Rgba8 y = b.pixels()[i];
    sum += std::abs(x.r - y.r) + std::abs(x.g - y.g) + std::abs(x.b - y.b);
  }
  return sum / 3.0 / static_cast<double>(a.pixels().size());
}

Image<Rgba8> received(Codec& receiver, std::span<const std::byte> bytes, Size size) {
  Image<Rgba8> picture(size, {1, 2, 3, 4});
  receiver.decode(bytes, picture);
  return picture;
}

struct Random {
  std::uint64_t state;
  std::uint64_t next() {
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    return state >> 20U;
  }
};

std::vector<std::byte> with_flipped_bit(std::vector<std::byte> bytes, std::size_t bit) {
  bytes[bit / 8] ^= std::byte{1} << (bit % 8);
  return bytes;
}

/// The pictures a camera makes that mostly stands: a square moves over the frame.
Image<Rgba8> moving(int step, Size size) {
  Image<Rgba8> picture = frame_like(size, 3);
  for (int y = 20; y < 40; ++y) {
    for (int x = 10 + 9 * step; x < 30 + 9 * step; ++x) picture.at(x % size.width, y) = {250, 20, 60, 255};
  }
  return picture;
}

class CodecTest : public ::testing::TestWithParam<std::string> {
 protected:
  [[nodiscard]] static bool exact() { return GetParam() != "jpeg"; }
};

INSTANTIATE_TEST_SUITE_P(All, CodecTest, ::testing::ValuesIn(all_codecs()),
                         [](const auto& test) { return test.param; });

/// Those that go on with a picture's codec from the second on.
class DeltaTest : public CodecTest {};

INSTANTIATE_TEST_SUITE_P(All, DeltaTest, ::testing::Values("raw", "lz4", "zstd", "jpeg"),
                         [](const auto& test) { return test.param; });

TEST_P(CodecTest, ReturnsPicturesOfAnySize) {
  for (const Size size :
       {Size{0, 0}, Size{1, 1}, Size{3, 1}, Size{1, 70}, Size{16, 1}, Size{17, 1}, Size{63, 65}, Size{200, 130}}) {
    const auto sender = make_codec(GetParam(), {});
    EXPECT_EQ(sender->name(), GetParam());
    const Image<Rgba8> picture = frame_like(size, 1);
    const Image<Rgba8> arrived = received(*make_codec(GetParam(), {}), sender->encode(picture), size);
    if (exact()) {
      EXPECT_EQ(arrived, picture) << size.width << "x" << size.height;
    } else if (size.area() > 0) {
      EXPECT_EQ(arrived.at(size.width - 1, 0).a, 255) << "alpha is dropped";
    }
  }
}

TEST_P(CodecTest, KeepsItsBoundForEveryChannelOfEveryPixel) {
  const Image<Rgba8> picture = frame_like({200, 130}, 4);
  for (const int error : {1, 2, 7, 127, 255}) {
    const CodecSettings settings{.quality = 60, .error = error};
    const auto arrived =
        received(*make_codec(GetParam(), {}), make_codec(GetParam(), settings)->encode(picture), picture.size());
    EXPECT_LE(largest_difference(arrived, picture), error);
  }
}

TEST_P(CodecTest, EveryFlippedBitAndEveryCutIsFound) {
  const Image<Rgba8> picture = frame_like({160, 90}, 2);
  const std::vector<std::byte> good = make_codec(GetParam(), {.error = 2})->encode(picture);
  const auto receiver = make_codec(GetParam(), {});
  Random random{7};
  for (int i = 0; i < 1000; ++i) {
    const std::size_t bit = random.next() % (good.size() * 8);
    std::vector<std::byte> bad = with_flipped_bit(good, bit);
    if (i % 10 == 0) bad.resize(bit / 8);
    try {
      static_cast<void>(received(*receiver, bad, picture.size()));
      ADD_FAILURE() << "bit " << bit;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::BadInput);
    }
  }
  EXPECT_LE(largest_difference(received(*receiver, good, picture.size()), picture), 2);
}

/// What a checksum cannot find: who writes it can also write it anew. Such bytes may be refused or become a wrong
/// picture of the right size, and nothing else.
TEST_P(CodecTest, ForgedBytesDoNoHarm) {
  const Size size{160, 90};
  for (const int error : {0, 2}) {
    const CodecSettings settings{.error = error, .deltas = true};
    const auto sender = make_codec(GetParam(), settings);
    const std::vector<std::byte> whole = sender->encode(moving(0, size));
    const std::vector<std::byte> tiles = sender->encode(moving(1, size));
    Random random{11};
    for (int i = 0; i < 1000; ++i) {
      const auto receiver = make_codec(GetParam(), settings);
      static_cast<void>(received(*receiver, whole, size));
      const std::vector<std::byte>& good = i % 2 == 0 ? whole : tiles;
      const std::size_t body_bits = (good.size() - sizeof(Envelope)) * 8;
      // Mostly near the start, where the lengths stand.
      const std::size_t reach = i % 3 == 0 ? body_bits : std::min<std::size_t>(body_bits, 400);
      std::vector<std::byte> bad = with_flipped_bit(good, sizeof(Envelope) * 8 + random.next() % reach);
      if (i % 5 == 0) bad.resize(sizeof(Envelope) + random.next() % (bad.size() - sizeof(Envelope)));
      Envelope envelope;
      std::memcpy(&envelope, good.data(), sizeof(Envelope));
      if (i % 7 == 0) envelope.coder = static_cast<std::uint8_t>(random.next() % 6);
      if (i % 11 == 0) envelope.flags = static_cast<std::uint8_t>(random.next());
      seal(envelope, bad);
      try {
        EXPECT_EQ(received(*receiver, bad, size).size(), size);
      } catch (const Error& refusal) {
        EXPECT_EQ(refusal.code(), ExitCode::BadInput);
      }
    }
  }
}

TEST_P(DeltaTest, TilesThatStayCostAlmostNothing) {
  const Size size{320, 200};
  for (const int error : {0, 2}) {
    const CodecSettings settings{.quality = 95, .error = error, .deltas = true};
    const auto sender = make_codec(GetParam(), settings);
    const auto receiver = make_codec(GetParam(), settings);
    std::size_t whole = 0;
    for (int step = 0; step < 12; ++step) {
      const Image<Rgba8> picture = moving(step / 2, size);  // every second one is the one before
      const std::vector<std::byte> bytes = sender->encode(picture);
      if (step == 0) {
        whole = bytes.size();
      } else if (step % 2 == 1) {
        EXPECT_LT(bytes.size(), 60U);
      } else {
        EXPECT_LT(bytes.size(), whole / 2);
      }
      const Image<Rgba8> arrived = received(*receiver, bytes, size);
      if (exact() || error > 0) {
        EXPECT_LE(largest_difference(arrived, picture), error) << "step " << step;
      } else {
        EXPECT_LT(mean_difference(arrived, picture), 8.0) << "step " << step;
      }
    }
  }
}

TEST_P(DeltaTest, AMissedPictureIsToldAndNeverAWrongPicture) {
  const Size size{200, 130};
  const CodecSettings settings{.error = 1, .deltas = true};
  const auto sender = make_codec(GetParam(), settings);
  const auto receiver = make_codec(GetParam(), settings);
  static_cast<void>(received(*receiver, sender->encode(moving(0, size)), size));
  static_cast<void>(sender->encode(moving(1, size)));  // lost on the way
  const std::vector<std::byte> third = sender->encode(moving(2, size));
  try {
    static_cast<void>(received(*receiver, third, size));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::BadInput);
    EXPECT_STREQ(error.what(), "encoded picture 3 builds on one that is not the last one here: the last one here is 1");
  }
  sender->restart();
  const Image<Rgba8> picture = moving(3, size);
  EXPECT_LE(largest_difference(received(*receiver, sender->encode(picture), size), picture), 1);
}

TEST_P(DeltaTest, TilesOfAnotherStreamAreRefused) {
  const Size size{200, 130};
  const auto a = make_codec(GetParam(), {.deltas = true});
  const auto b = make_codec(GetParam(), {.deltas = true});
  const auto receiver = make_codec(GetParam(), {.deltas = true});
  static_cast<void>(received(*receiver, a->encode(moving(0, size)), size));
  static_cast<void>(b->encode(moving(1, size)));
  EXPECT_THROW(static_cast<void>(received(*receiver, b->encode(moving(2, size)), size)), Error)
      << "its number fits, but not its base";
}

TEST_P(CodecTest, AnotherSizeStartsTheStreamAnew) {
  const auto sender = make_codec(GetParam(), {.error = 1, .deltas = true});
  const auto receiver = make_codec(GetParam(), {.error = 1, .deltas = true});
  for (const Size size : {Size{200, 130}, Size{130, 200}, Size{130, 200}, Size{0, 0}, Size{0, 0}, Size{64, 64}}) {
    const Image<Rgba8> picture = frame_like(size, 5);
    EXPECT_LE(largest_difference(received(*receiver, sender->encode(picture), size), picture), 1);
  }
}

TEST(Codecs, ABoundMakesPicturesSmaller) {
  const Image<Rgba8> picture = frame_like({320, 200}, 6);
  for (const char* const name : {"lz4", "zstd"}) {
    const std::size_t exact = make_codec(name, {})->encode(picture).size();
    EXPECT_LT(exact, picture.pixels().size_bytes()) << name;
    EXPECT_LT(static_cast<double>(make_codec(name, {.error = 3})->encode(picture).size()),
              0.95 * static_cast<double>(exact))
        << name;
  }
}

TEST(Codecs, NoiseWithinTheBoundIsNotSentAgain) {
  Image<Rgba8> picture({128, 128}, {100, 100, 100, 255});
  const auto sender = make_codec("zstd", {.error = 4, .deltas = true});
  static_cast<void>(sender->encode(picture));
  picture.at(70, 3).g = 101;
  EXPECT_LT(sender->encode(picture).size(), 60U);
  picture.at(70, 3).a = 254;
  EXPECT_GT(sender->encode(picture).size(), 60U) << "alpha stays as it is";
}

TEST(Codecs, JpegsQualityTradesSizeForError) {
  const Image<Rgba8> picture = frame_like({320, 200}, 6);
  std::size_t larger = 0;
  double worse = 256.0;
  for (const int quality : {30, 70, 95}) {
    const auto bytes = make_codec("jpeg", {.quality = quality})->encode(picture);
    const double error = mean_difference(received(*make_codec("jpeg", {}), bytes, picture.size()), picture);
    EXPECT_GT(bytes.size(), larger);
    EXPECT_LT(error, worse);
    larger = bytes.size();
    worse = error;
  }
}

TEST(Codecs, JpegSaysWhatItCannotTake) {
  try {
    static_cast<void>(make_codec("jpeg", {})->encode(Image<Rgba8>({65501, 1})));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::Limit);
  }
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
