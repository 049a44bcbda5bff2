#include "image/image_io.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <webp/decode.h>
#include <webp/encode.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <random>
#include <span>
#include <string_view>

#include "core/error.h"
#include "core/file.h"
#include "image/test_files.h"

namespace hpr {
namespace {

using test::adobe_marker;
using test::Bytes;
using test::bytes_of;
using test::Chunk;
using test::make_jpeg;
using test::make_png;

template <typename Call>
ExitCode code_of(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return error.code();
  }
  return ExitCode::Done;
}

ExitCode decode_code(const Bytes& bytes, const ImageLimits& limits = {}) {
  return code_of([&] { (void)decode_image(bytes, "a.png", limits); });
}

/// The most that this process ever used.
long max_memory_kib() {
  rusage usage{};
  EXPECT_EQ(::getrusage(RUSAGE_SELF, &usage), 0);
  return usage.ru_maxrss;
}

Image<Rgba8> pattern(Size size) {
  Image<Rgba8> image(size);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      image.at(x, y) = {static_cast<std::uint8_t>(x * 7), static_cast<std::uint8_t>(y * 11),
                        static_cast<std::uint8_t>(x ^ y), static_cast<std::uint8_t>(x + 3 * y)};
    }
  }
  return image;
}

FloatImage through_file(const Bytes& bytes, const std::string& extension, const ImageLimits& limits = {}) {
  const auto path = std::filesystem::temp_directory_path() /
                    ("hpr-image-test-" + std::to_string(::testing::UnitTest::GetInstance()->random_seed()) + "-" +
                     ::testing::UnitTest::GetInstance()->current_test_info()->name() + extension);
  write_file_atomically(path, bytes);
  struct Remove {
    const std::filesystem::path& path;
    ~Remove() { std::filesystem::remove(path); }
  } const remove{path};
  return read_image(path, limits);
}

/// The values of one channel, found by name: EXR files keep channels in alphabetical order.
std::vector<float> channel(const FloatImage& image, const std::string& name) {
  const auto found = std::ranges::find(image.channels, name);
  if (found == image.channels.end()) return {};
  std::vector<float> values;
  for (auto i = static_cast<std::size_t>(found - image.channels.begin()); i < image.values.size();
       i += image.channels.size()) {
    values.push_back(image.values[i]);
  }
  return values;
}

std::vector<std::uint32_t> bits_of(const std::vector<float>& values) {
  std::vector<std::uint32_t> bits;
  for (const float value : values) bits.push_back(std::bit_cast<std::uint32_t>(value));
  return bits;
}

TEST(ImageIo, PngGivesBackEveryByteAlsoUnderZeroAlpha) {
  for (const Size size : {Size{1, 1}, Size{3, 5}, Size{257, 64}}) {
    const Image<Rgba8> image = pattern(size);
    EXPECT_EQ(decode_image(encode_png(image), "a.png", {}), image);
  }
}

TEST(ImageIo, PngFilesReadAsLevelsOver255) {
  const FloatImage read = through_file(encode_png(Image<Rgba8>({1, 1}, {0, 51, 255, 128})), ".png");
  EXPECT_EQ(read.size, (Size{1, 1}));
  ASSERT_EQ(read.values.size(), 4U);
  EXPECT_FLOAT_EQ(read.values[0], 0.0F);
  EXPECT_FLOAT_EQ(read.values[1], 0.2F);
  EXPECT_FLOAT_EQ(read.values[2], 1.0F);
  EXPECT_FLOAT_EQ(read.values[3], 128.0F / 255.0F);
}

TEST(ImageIo, PicturesSayWhetherTheyAreLinear) {
  EXPECT_FALSE(through_file(encode_png(Image<Rgba8>({1, 1})), ".png").linear);
  EXPECT_TRUE(through_file(encode_exr(Image<Rgb>({1, 1}), {}), ".exr").linear);
  EXPECT_TRUE(through_file(encode_exr(Image<Rgb>({1, 1}), {}), ".png").linear) << "whatever its name says";
}

TEST(ImageIo, GreyPngBecomesEqualChannels) {
  const auto grey = make_png(2, 2, 8, 0, {bytes_of({0, 0, 255}), bytes_of({0, 7, 128})});
  const Image<Rgba8> image = decode_image(grey, "grey.png", {});
  EXPECT_EQ(image.at(1, 0), (Rgba8{255, 255, 255, 255}));
  EXPECT_EQ(image.at(0, 1), (Rgba8{7, 7, 7, 255}));
  const auto with_alpha = make_png(1, 1, 8, 4, {bytes_of({0, 9, 40})});
  EXPECT_EQ(decode_image(with_alpha, "grey.png", {}).at(0, 0), (Rgba8{9, 9, 9, 40}));
}

TEST(ImageIo, SixteenBitPngIsRoundedToEight) {
  // 0x0080 is 0.498 of a level, 0x0081 is 0.502; 0xFF7F is 254.502.
  const auto rgb =
      make_png(2, 1, 16, 2, {bytes_of({0, 0x00, 0x80, 0x00, 0x81, 0xFF, 0x7F, 0xFF, 0xFF, 0x80, 0x80, 0, 0})});
  const Image<Rgba8> image = decode_image(rgb, "deep.png", {});
  EXPECT_EQ(image.at(0, 0), (Rgba8{0, 1, 255, 255}));
  EXPECT_EQ(image.at(1, 0), (Rgba8{255, 128, 0, 255}));
}

TEST(ImageIo, SixteenBitPngKeepsItsLevelsAsFloats) {
  const FloatImage read = through_file(make_png(2, 1, 16, 0, {bytes_of({0, 0x01, 0x02, 0xFF, 0xFF})}), ".png");
  EXPECT_EQ(read.channels, (std::vector<std::string>{"Y"}));
  EXPECT_EQ(read.levels, 0xFFFFU);
  EXPECT_EQ(read.values, (std::vector<float>{258.0F / 65535.0F, 1.0F}));
}

TEST(ImageIo, PalettesFewBitsAndTransparentColorsAreExpanded) {
  const Chunk palette{"PLTE", bytes_of({10, 20, 30, 40, 50, 60, 70, 80, 90})};
  const Chunk alphas{"tRNS", bytes_of({0, 128})};
  const Image<Rgba8> image =
      decode_image(make_png(3, 1, 2, 3, {bytes_of({0, 0b00011000})}, {palette, alphas}), "a", {});
  EXPECT_EQ(image.at(0, 0), (Rgba8{10, 20, 30, 0}));
  EXPECT_EQ(image.at(1, 0), (Rgba8{40, 50, 60, 128}));
  EXPECT_EQ(image.at(2, 0), (Rgba8{70, 80, 90, 255}));

  const Image<Rgba8> bits = decode_image(make_png(3, 1, 1, 0, {bytes_of({0, 0b01000000})}), "a", {});
  EXPECT_EQ(bits.at(0, 0), (Rgba8{0, 0, 0, 255}));
  EXPECT_EQ(bits.at(1, 0), (Rgba8{255, 255, 255, 255}));

  const Chunk white{"tRNS", bytes_of({0, 255})};
  const Image<Rgba8> grey = decode_image(make_png(2, 1, 8, 0, {bytes_of({0, 255, 7})}, {white}), "a", {});
  EXPECT_EQ(grey.at(0, 0), (Rgba8{255, 255, 255, 0}));
  EXPECT_EQ(grey.at(1, 0), (Rgba8{7, 7, 7, 255}));
}

TEST(ImageIo, InterlacedPngGivesItsPixelsInOrder) {
  // Adam7 of 3 x 3 pixels: pass 1 has (0,0), pass 4 (2,0), pass 5 (0,2) and (2,2), pass 6 (1,0) and (1,2), pass 7
  // row 1.
  const std::vector<Bytes> passes{bytes_of({0, 1}), bytes_of({0, 3}), bytes_of({0, 7, 9}),
                                  bytes_of({0, 2}), bytes_of({0, 8}), bytes_of({0, 4, 5, 6})};
  const Image<Rgba8> image = decode_image(make_png(3, 3, 8, 0, passes, {}, 1), "a", {});
  for (int i = 0; i < 9; ++i) EXPECT_EQ(image.at(i % 3, i / 3).r, i + 1) << i;
}

/// Profiles and other notes are not looked at, so what is wrong with them hurts nobody: OpenImageIO 2.4 reads behind
/// the end of a profile whose header lies about its size.
TEST(ImageIo, NotesInAPngFileAreSkipped) {
  const std::vector<Bytes> rows{bytes_of({0, 1, 2, 3})};
  const Image<Rgba8> plain = decode_image(make_png(1, 1, 8, 2, rows), "a", {});
  // A name, deflate, and a stored block of 130 bytes, the profile: it says that it has 2 GiB, and 2^32 - 1 tags.
  Bytes profile = bytes_of({'x', 0, 0, 0x78, 0x01, 1, 130, 0, 125, 255, 0x7F, 0xFF, 0xFF, 0xFF});
  profile.resize(profile.size() + 124, std::byte{'a'});
  profile.insert(profile.end(), 4, std::byte{0xFF});
  for (const std::string_view type : {"iCCP", "eXIf", "zTXt", "iTXt", "tEXt", "gAMA", "cHRM", "sPLT", "hIST", "pCAL",
                                      "sCAL", "tIME", "bKGD", "sBIT", "pHYs", "oFFs", "sRGB", "acTL", "juNk"}) {
    for (const Bytes& data : {profile, Bytes(), Bytes(3, std::byte{0xFF}), Bytes(100000, std::byte{'k'})}) {
      const Bytes file = make_png(1, 1, 8, 2, rows, {{type, data}, {type, data}});
      EXPECT_EQ(decode_image(file, "a", {}), plain) << type << ' ' << data.size();
      EXPECT_EQ(through_file(file, ".png").values.size(), 3U) << type << ' ' << data.size();
    }
  }
}

TEST(ImageIo, JpegGivesGreyAndColors) {
  const Image<Rgba8> grey = decode_image(make_jpeg({77}), "a.jpg", {});
  EXPECT_EQ(grey, Image<Rgba8>({8, 8}, {77, 77, 77, 255}));
  EXPECT_EQ(through_file(make_jpeg({77}), ".jpg").channels, (std::vector<std::string>{"Y"}));
  // Y, Cb, Cr without color is grey; Adobe's transform 0 says that the components are R, G, B.
  EXPECT_EQ(decode_image(make_jpeg({200, 128, 128}), "a.jpg", {}).at(3, 4), (Rgba8{200, 200, 200, 255}));
  EXPECT_EQ(decode_image(make_jpeg({200, 100, 7}, adobe_marker(0)), "a.jpg", {}).at(3, 4), (Rgba8{200, 100, 7, 255}));
  // Cr of 40 above the middle: R = Y + 1.402 * 40, G = Y - 0.714136 * 40.
  EXPECT_EQ(decode_image(make_jpeg({100, 128, 168}), "a.jpg", {}).at(7, 7), (Rgba8{156, 71, 100, 255}));
}

TEST(ImageIo, JpegOfInksBecomesLight) {
  // Adobe stores how much light passes; others store how much ink there is.
  EXPECT_EQ(decode_image(make_jpeg({255, 128, 51, 255}, adobe_marker(0)), "a.jpg", {}).at(0, 0),
            (Rgba8{255, 128, 51, 255}));
  EXPECT_EQ(decode_image(make_jpeg({255, 128, 51, 51}, adobe_marker(0)), "a.jpg", {}).at(0, 0),
            (Rgba8{51, 26, 10, 255}));
  EXPECT_EQ(decode_image(make_jpeg({0, 127, 204, 0}), "a.jpg", {}).at(0, 0), (Rgba8{255, 128, 51, 255}));
}

TEST(ImageIo, NotesInAJpegFileAreSkipped) {
  const Image<Rgba8> plain = decode_image(make_jpeg({77}), "a.jpg", {});
  for (int marker = 0xE1; marker <= 0xEF; ++marker) {
    if (marker == 0xEE) continue;  // Adobe's own, which says what the components are
    Bytes segment = bytes_of({0xFF, marker, 0x01, 0x02});
    for (const char c : std::string_view("ICC_PROFILE\0\xFF\0", 14)) segment.push_back(static_cast<std::byte>(c));
    segment.resize(2 + 0x102, std::byte{0xFF});
    EXPECT_EQ(decode_image(make_jpeg({77}, segment), "a.jpg", {}), plain) << marker;
  }
}

TEST(ImageIo, JpegPastTheLimitOrDamagedIsRefused) {
  const Bytes good = make_jpeg({50, 100, 150});
  EXPECT_EQ(decode_code(good, {.side = 8, .pixels = 64}), ExitCode::Done);
  EXPECT_EQ(decode_code(good, {.side = 7, .pixels = 64}), ExitCode::Limit);
  EXPECT_EQ(decode_code(good, {.side = 8, .pixels = 63}), ExitCode::Limit);
  for (std::size_t kept = 3; kept + 2 < good.size(); ++kept) {
    EXPECT_EQ(decode_code({good.begin(), good.begin() + static_cast<std::ptrdiff_t>(kept)}), ExitCode::BadInput)
        << kept;
  }
}

/// Random levels, of one colour with neighbours, so that some of it can be predicted.
std::vector<std::uint8_t> random_levels(std::mt19937& random, Size size, std::size_t channels) {
  std::vector<std::uint8_t> levels(size.area() * channels);
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const bool repeats = i >= channels && random() % 3 != 0;
    levels[i] = repeats ? levels[i - channels] : static_cast<std::uint8_t>(random());
  }
  return levels;
}

/// What WebPEncode... made, copied from its memory.
Bytes webp_bytes(std::uint8_t* memory, std::size_t size) {
  EXPECT_GT(size, 0U);
  const auto bytes = std::as_bytes(std::span(memory, size));
  Bytes copy(bytes.begin(), bytes.end());
  WebPFree(memory);
  return copy;
}

Bytes lossless_webp(const std::vector<std::uint8_t>& levels, Size size, std::size_t channels) {
  std::uint8_t* out = nullptr;
  const int stride = size.width * static_cast<int>(channels);
  const std::size_t bytes = channels == 4 ? WebPEncodeLosslessRGBA(levels.data(), size.width, size.height, stride, &out)
                                          : WebPEncodeLosslessRGB(levels.data(), size.width, size.height, stride, &out);
  return webp_bytes(out, bytes);
}

TEST(ImageIo, LosslessWebpGivesBackEveryByte) {
  std::mt19937 random(1);
  for (int i = 0; i < 20; ++i) {
    const Size size{1 + static_cast<int>(random() % 90), 1 + static_cast<int>(random() % 90)};
    const std::size_t channels = i % 2 == 0 ? 4 : 3;
    std::vector<std::uint8_t> levels = random_levels(random, size, channels);
    // The encoder drops the colour where nothing is to be seen.
    for (std::size_t k = 3; channels == 4 && k < levels.size(); k += 4)
      levels[k] = std::max<std::uint8_t>(levels[k], 1);
    const Image<Rgba8> image = decode_image(lossless_webp(levels, size, channels), "a.webp", {});
    ASSERT_EQ(image.size(), size);
    for (std::size_t p = 0; p < size.area(); ++p) {
      const std::uint8_t* const from = levels.data() + p * channels;
      const Rgba8 expected{from[0], from[1], from[2], channels == 4 ? from[3] : std::uint8_t{255}};
      ASSERT_EQ(image.pixels()[p], expected) << i << " " << p;
    }
  }
}

TEST(ImageIo, LossyWebpIsClose) {
  const Size size{64, 48};
  std::vector<std::uint8_t> levels;
  for (int i = 0; i < size.width * size.height; ++i) {
    for (const int level : {i % 64 * 4, i / 64 * 5, 128, 255 - i / 64 * 4})
      levels.push_back(static_cast<std::uint8_t>(level));
  }
  std::uint8_t* out = nullptr;
  const std::size_t bytes = WebPEncodeRGBA(levels.data(), size.width, size.height, size.width * 4, 95.0F, &out);
  const Image<Rgba8> image = decode_image(webp_bytes(out, bytes), "a.webp", {});
  double sum = 0.0;
  for (std::size_t p = 0; p < size.area(); ++p) {
    sum += std::abs(image.pixels()[p].r - levels[4 * p]) + std::abs(image.pixels()[p].g - levels[4 * p + 1]) +
           std::abs(image.pixels()[p].b - levels[4 * p + 2]);
    EXPECT_EQ(image.pixels()[p].a, levels[4 * p + 3]);
  }
  EXPECT_LT(sum / static_cast<double>(3 * size.area()), 3.0);
}

TEST(ImageIo, WebpFilesReadAsLevelsOver255) {
  const FloatImage image = through_file(lossless_webp({51, 102, 255}, {1, 1}, 3), ".webp");
  EXPECT_EQ(image.channels, (std::vector<std::string>{"R", "G", "B"}));
  EXPECT_EQ(image.values, (std::vector<float>{51 / 255.0F, 102 / 255.0F, 1.0F}));
  EXPECT_FALSE(image.linear);
}

TEST(ImageIo, WebpPastTheLimitAnimatedOrDamagedIsRefused) {
  std::mt19937 random(2);
  const Size size{40, 30};
  const Bytes good = lossless_webp(random_levels(random, size, 3), size, 3);
  EXPECT_EQ(decode_code(good, {.side = 39, .pixels = 1 << 20}), ExitCode::Limit);
  EXPECT_EQ(decode_code(good, {.side = 100, .pixels = 1199}), ExitCode::Limit);
  for (std::size_t length = 12; length < good.size(); ++length) {
    EXPECT_EQ(decode_code(Bytes(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(length))), ExitCode::BadInput)
        << length;
  }
  for (int i = 0; i < 500; ++i) {
    Bytes bad = good;
    for (int k = 0; k < 3; ++k) bad[12 + random() % (bad.size() - 12)] ^= static_cast<std::byte>(1 + random() % 255);
    const ExitCode code = decode_code(bad);
    EXPECT_TRUE(code == ExitCode::Done || code == ExitCode::BadInput || code == ExitCode::Limit);
  }
  // VP8X with the flag of animations, and no frame; then 16384 x 16384 pixels that are not there.
  const Bytes animated = bytes_of({'R', 'I', 'F', 'F', 22, 0, 0, 0, 'W', 'E', 'B', 'P', 'V', 'P', '8',
                                   'X', 10,  0,   0,   0,  2, 0, 0, 0,   7,   0,   0,   7,   0,   0});
  try {
    (void)decode_image(animated, "a.webp", {});
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("animation"), std::string::npos) << error.what();
  }
  const Bytes huge = bytes_of({'R', 'I', 'F', 'F',  26,   0,    0,    0,    'W', 'E', 'B', 'P', 'V', 'P', '8', 'L', 14,
                               0,   0,   0,   0x2F, 0xFF, 0xFF, 0xFF, 0x0F, 0,   0,   0,   0,   0,   0,   0,   0,   0});
  const long before = max_memory_kib();
  EXPECT_EQ(decode_code(huge), ExitCode::Limit);
  EXPECT_LT(max_memory_kib() - before, 64L << 10);
}

TEST(ImageIo, Ktx2IsRefusedWithTheProgramThatConvertsIt) {
  const Bytes file = bytes_of({0xAB, 'K', 'T', 'X', ' ', '2', '0', 0xBB, '\r', '\n', 0x1A, '\n', 0, 0, 0, 0});
  try {
    (void)decode_image(file, "a.ktx2", {});
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::BadInput);
    EXPECT_NE(std::string(error.hint()).find("ktx extract"), std::string::npos) << error.hint();
  }
}

TEST(ImageIo, SizesPastTheLimitAreRefusedByTheHeaderAlone) {
  // 40 GB of pixels that are not there: decoding them would be another error, allocating them would end the test.
  EXPECT_EQ(decode_code(make_png(100000, 100000, 8, 6, {})), ExitCode::Limit);
  const long before = max_memory_kib();
  EXPECT_EQ(decode_code(make_png(0x7FFFFFFF, 1, 8, 6, {})), ExitCode::Limit);
  EXPECT_LT(max_memory_kib() - before, 1L << 20) << "a row has 8 GiB";
  const auto small = make_png(4, 4, 8, 0, std::vector<Bytes>(4, bytes_of({0, 1, 2, 3, 4})));
  EXPECT_EQ(decode_code(small, {.side = 4, .pixels = 16}), ExitCode::Done);
  EXPECT_EQ(decode_code(small, {.side = 3, .pixels = 16}), ExitCode::Limit);
  EXPECT_EQ(decode_code(small, {.side = 4, .pixels = 15}), ExitCode::Limit);
}

TEST(ImageIo, DamagedPicturesAreBadInput) {
  const Bytes good = encode_png(pattern({40, 40}));
  EXPECT_EQ(decode_code({}), ExitCode::BadInput);
  EXPECT_EQ(decode_code(bytes_of({'G', 'I', 'F', '8', '9', 'a'})), ExitCode::BadInput);
  EXPECT_EQ(decode_code(bytes_of({0xFF, 0xD8, 0xFF, 0xE0, 0, 0})), ExitCode::BadInput) << "a JPEG that ends at once";
  for (const std::size_t kept : {std::size_t{8}, std::size_t{20}, std::size_t{33}, good.size() / 2}) {
    EXPECT_EQ(decode_code({good.begin(), good.begin() + static_cast<std::ptrdiff_t>(kept)}), ExitCode::BadInput)
        << kept;
  }
  Bytes flipped = good;
  flipped[good.size() / 2] ^= std::byte{0x55};
  EXPECT_EQ(decode_code(flipped), ExitCode::BadInput);
  EXPECT_EQ(decode_code(encode_exr(Image<Rgb>({2, 2}), {})), ExitCode::BadInput) << "textures are never EXR";
}

TEST(ImageIo, ErrorsNameThePicture) {
  try {
    (void)decode_image(bytes_of({1, 2, 3}), "wood.png", {});
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("wood.png"), std::string::npos);
  }
}

TEST(ImageIo, ExrGivesBackEveryBitOfEveryFloat) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const std::vector<float> odd{0.0F,
                               -0.0F,
                               1.0F / 3.0F,
                               std::numeric_limits<float>::denorm_min(),
                               -1e-40F,
                               std::numeric_limits<float>::max(),
                               kInfinity,
                               -kInfinity,
                               std::bit_cast<float>(0x7FC00001U),
                               std::bit_cast<float>(0xFFC12345U),
                               std::bit_cast<float>(123456789U)};
  Image<Rgb> image({static_cast<int>(odd.size()), 2});
  std::vector<float> green;
  for (int y = 0; y < 2; ++y) {
    for (std::size_t x = 0; x < odd.size(); ++x) {
      image.at(static_cast<int>(x), y) = {odd[x], odd[(x + 3) % odd.size()], odd[(x + 5) % odd.size()]};
      green.push_back(odd[(x + 3) % odd.size()]);
    }
  }
  std::vector<float> ids;
  for (std::size_t i = 0; i < image.pixels().size(); ++i)
    ids.push_back(std::bit_cast<float>(static_cast<std::uint32_t>(i * 77777777)));
  const std::vector<ExrLayer> layers{{{"normal.X", "normal.Y"},
                                      [&] {
                                        std::vector<float> values;
                                        for (std::size_t i = 0; i < ids.size(); ++i) {
                                          values.push_back(static_cast<float>(i));
                                          values.push_back(-static_cast<float>(i));
                                        }
                                        return values;
                                      }()},
                                     {{"id"}, ids}};
  const FloatImage read = through_file(encode_exr(image, {{"hpr:seed", "1"}}, layers), ".exr");
  EXPECT_EQ(read.size, image.size());
  EXPECT_EQ(read.channels.size(), 6U);
  EXPECT_EQ(bits_of(channel(read, "G")), bits_of(green));
  EXPECT_EQ(bits_of(channel(read, "id")), bits_of(ids));
  EXPECT_EQ(channel(read, "normal.X")[3], 3.0F);
  EXPECT_EQ(channel(read, "normal.Y")[3], -3.0F);
}

TEST(ImageIo, ExrIntegersKeepTheirBitsBesideFloats) {
  const Image<Rgb> image({3, 1}, {0.5F, -1e30F, std::numeric_limits<float>::denorm_min()});
  const std::vector<std::uint32_t> ids{0U, 0x01000001U, 0xFFFFFFFFU};  // the middle one is no float
  const std::vector<ExrLayer> layers{{{"id.X"}, {}, ids}, {{"depth.Z"}, {1.0F, 2.0F, 3.0F}}};
  const Bytes file = encode_exr(image, {}, layers);
  const FloatImage floats = through_file(file, ".exr");
  EXPECT_EQ(bits_of(channel(floats, "R")), bits_of(std::vector<float>(3, 0.5F)));
  EXPECT_EQ(bits_of(channel(floats, "B")), bits_of(std::vector<float>(3, std::numeric_limits<float>::denorm_min())));
  EXPECT_EQ(channel(floats, "depth.Z"), (std::vector<float>{1.0F, 2.0F, 3.0F}));
  ASSERT_EQ(floats.integers.size(), 1U);
  EXPECT_EQ(floats.integers.at("id.X"), ids);
  EXPECT_EQ(floats.levels, 0U);
}

TEST(ImageIo, ExrWhoseDataBeginElsewhereGivesItsPixels) {
  Image<Rgb> image({2, 2});
  for (int i = 0; i < 4; ++i) {
    const auto first = static_cast<float>(3 * i + 1);
    image.at(i % 2, i / 2) = {first, first + 1.0F, first + 2.0F};
  }
  Bytes file = encode_exr(image, {});
  const std::array<std::int32_t, 4> moved{-5, 1000, -4, 1001};
  const auto window = std::ranges::search(file, std::as_bytes(std::span("dataWindow\0box2i", 17)));
  ASSERT_FALSE(window.empty());
  std::memcpy(&*window.end() + 4, moved.data(), sizeof moved);
  // The one chunk, its row, follows the header's end and the table with its place in the file.
  std::uint64_t chunk = 0;
  for (std::size_t i = 0; i + 8 < file.size(); ++i) {
    std::memcpy(&chunk, file.data() + i, sizeof chunk);
    if (chunk == i + 8) break;
  }
  ASSERT_LT(chunk, file.size());
  std::memcpy(file.data() + chunk, &moved[1], sizeof moved[1]);
  const FloatImage read = through_file(file, ".exr");
  EXPECT_EQ(read.size, (Size{2, 2}));
  EXPECT_EQ(read.channels, (std::vector<std::string>{"R", "G", "B"}));
  EXPECT_EQ(read.values, (std::vector<float>{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}));
}

TEST(ImageIo, AnExrAttributeThatIsLargerThanItsFileIsRefused) {
  Bytes file = encode_exr(Image<Rgb>({2, 2}), {{"note", "x"}});
  const auto note = std::ranges::search(file, std::as_bytes(std::span("note\0string", 12)));
  ASSERT_FALSE(note.empty());
  for (const std::int32_t size : {-1, 1 << 30, std::numeric_limits<std::int32_t>::max()}) {
    std::memcpy(&*note.end(), &size, sizeof size);
    EXPECT_EQ(code_of([&] { (void)through_file(file, ".exr"); }), ExitCode::BadInput) << size;
  }
}

/// OpenEXR goes by an attribute's type, not by the length the file gives it: what follows would be read out of step, a
/// length in it as gigabytes.
TEST(ImageIo, ExrAttributesHaveTheLengthOfTheirType) {
  const Bytes good = encode_exr(Image<Rgb>({2, 2}), {{"note", "x"}});
  EXPECT_EQ(code_of([&] { (void)decode_float_image(good, "a.exr", {}); }), ExitCode::Done);
  for (const std::string_view head :
       {std::string_view("channels\0chlist", 15), std::string_view("dataWindow\0box2i", 16),
        std::string_view("compression\0compression", 23), std::string_view("screenWindowWidth\0float", 23)}) {
    for (const std::int32_t more : {-1, 1}) {
      Bytes file = good;
      const auto found = std::ranges::search(file, std::as_bytes(std::span(head.data(), head.size() + 1)));
      ASSERT_FALSE(found.empty()) << head;
      std::int32_t size = 0;
      std::memcpy(&size, &*found.end(), sizeof size);
      size += more;
      std::memcpy(&*found.end(), &size, sizeof size);
      try {
        (void)decode_float_image(file, "a.exr", {});
        ADD_FAILURE() << head;
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ExitCode::BadInput);
        EXPECT_NE(std::string(error.what()).find("does not hold together"), std::string::npos) << error.what();
      }
    }
  }
}

TEST(ImageIo, RadianceFilesAreReadByTheirModule) {
  Bytes file;
  for (const char c : std::string_view("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n"))
    file.push_back(std::byte(c));
  const Bytes pixels = bytes_of({128, 64, 0, 129, 128, 128, 128, 130});
  file.insert(file.end(), pixels.begin(), pixels.end());
  const FloatImage read = through_file(file, ".hdr");
  EXPECT_TRUE(read.linear);
  ASSERT_EQ(read.values.size(), 6U);
  EXPECT_NEAR(read.values[0], 1.0F, 0.01F);
  EXPECT_NEAR(read.values[1], 0.5F, 0.01F);
  EXPECT_NEAR(read.values[5], 2.0F, 0.02F);
  file.resize(file.size() - 3);
  EXPECT_EQ(code_of([&] { (void)through_file(file, ".hdr"); }), ExitCode::BadInput);
  EXPECT_EQ(code_of([&] { (void)through_file(file, ".hdr", {.side = 1, .pixels = 9}); }), ExitCode::Limit);
}

TEST(ImageIo, ExrPastTheLimitIsRefused) {
  const Bytes file = encode_exr(Image<Rgb>({4, 3}), {});
  EXPECT_EQ(code_of([&] { (void)through_file(file, ".exr", {.side = 4, .pixels = 12}); }), ExitCode::Done);
  EXPECT_EQ(code_of([&] { (void)through_file(file, ".exr", {.side = 3, .pixels = 12}); }), ExitCode::Limit);
  EXPECT_EQ(code_of([&] { (void)through_file(file, ".exr", {.side = 4, .pixels = 11}); }), ExitCode::Limit);
}

TEST(ImageIo, AnExrHeaderThatLiesAboutItsSizeIsRefusedBeforeAnyPixelIsAllocated) {
  const Bytes honest = encode_exr(Image<Rgb>({4, 4}), {});
  for (const std::int32_t last : {99999, 1 << 20, 1 << 30}) {
    Bytes file = honest;
    for (const std::string_view window :
         {std::string_view("dataWindow\0box2i", 16), std::string_view("displayWindow\0box2i", 19)}) {
      const auto found = std::ranges::search(file, std::as_bytes(std::span(window)));
      ASSERT_FALSE(found.empty());
      // After the type's zero and the size stand x0, y0, x1, y1, little-endian.
      for (const std::ptrdiff_t corner : {2, 3}) std::memcpy(&*found.end() + 5 + 4 * corner, &last, sizeof last);
    }
    try {
      (void)through_file(file, ".exr");
      ADD_FAILURE() << last;
    } catch (const Error& error) {
      EXPECT_TRUE(error.code() == ExitCode::Limit || error.code() == ExitCode::BadInput) << error.what();
    }
  }
}

TEST(ImageIo, DamagedExrIsBadInput) {
  Bytes file = encode_exr(Image<Rgb>({64, 64}, {0.1F, 0.2F, 0.3F}), {});
  file.resize(file.size() / 2);
  EXPECT_EQ(code_of([&] { (void)through_file(file, ".exr"); }), ExitCode::BadInput);
  file.resize(10);
  EXPECT_EQ(code_of([&] { (void)through_file(file, ".exr"); }), ExitCode::BadInput);
}

TEST(ImageIo, TheSamePictureMakesTheSameBytes) {
  EXPECT_EQ(encode_png(pattern({50, 30})), encode_png(pattern({50, 30})));
  EXPECT_EQ(encode_exr(Image<Rgb>({9, 9}), {{"a", "b"}}), encode_exr(Image<Rgb>({9, 9}), {{"a", "b"}}));
}

TEST(ImageIo, TheExtensionChoosesTheFormat) {
  EXPECT_EQ(code_of([] { write_image("picture.gif", Image<Rgb>({1, 1})); }), ExitCode::Usage);
  EXPECT_EQ(code_of([] { write_image("picture", Image<Rgb>({1, 1})); }), ExitCode::Usage);
}

TEST(ImageIoDeathTest, AnExrLayerOfAnotherSizeBreaksTheContract) {
  const std::vector<ExrLayer> layers{{{"depth"}, std::vector<float>(3)}};
  EXPECT_DEATH((void)encode_exr(Image<Rgb>({2, 2}), {}, layers), "broken contract");
}

}  // namespace
}  // namespace hpr
