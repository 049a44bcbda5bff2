#include "image/image_io.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <string_view>

#include "core/error.h"
#include "core/file.h"

namespace hpr {
namespace {

using Bytes = std::vector<std::byte>;

void put32(Bytes& out, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8)
    out.push_back(static_cast<std::byte>(value >> static_cast<unsigned>(shift)));
}

std::uint32_t crc32(std::span<const std::byte> bytes) {
  std::uint32_t crc = ~0U;
  for (const std::byte byte : bytes) {
    crc ^= static_cast<std::uint32_t>(byte);
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1U ^ ((crc & 1U) != 0 ? 0xEDB88320U : 0U);
  }
  return ~crc;
}

void put_chunk(Bytes& out, std::string_view type, const Bytes& data) {
  put32(out, static_cast<std::uint32_t>(data.size()));
  Bytes body(type.size() + data.size());
  std::memcpy(body.data(), type.data(), type.size());
  if (!data.empty()) std::memcpy(body.data() + type.size(), data.data(), data.size());
  out.insert(out.end(), body.begin(), body.end());
  put32(out, crc32(body));
}

/// A PNG file by its specification (ISO/IEC 15948), with uncompressed data. `rows`: each with its filter byte.
Bytes make_png(std::uint32_t width, std::uint32_t height, int bits, int color_type, const std::vector<Bytes>& rows) {
  Bytes file;
  for (const int b : {0x89, 0x50, 0x4E, 0x47, 0x0D, 0x0A, 0x1A, 0x0A}) file.push_back(static_cast<std::byte>(b));
  Bytes header;
  put32(header, width);
  put32(header, height);
  for (const int b : {bits, color_type, 0, 0, 0}) header.push_back(static_cast<std::byte>(b));
  put_chunk(file, "IHDR", header);

  Bytes raw;
  for (const Bytes& row : rows) raw.insert(raw.end(), row.begin(), row.end());
  Bytes data{std::byte{0x78}, std::byte{0x01}, std::byte{1}};
  const auto length = static_cast<std::uint16_t>(raw.size());
  for (const unsigned half : {unsigned{length}, ~unsigned{length} & 0xFFFFU}) {
    data.push_back(static_cast<std::byte>(half));
    data.push_back(static_cast<std::byte>(half >> 8U));
  }
  data.insert(data.end(), raw.begin(), raw.end());
  std::uint32_t a = 1;
  std::uint32_t b = 0;
  for (const std::byte byte : raw) {
    a = (a + static_cast<std::uint32_t>(byte)) % 65521;
    b = (b + a) % 65521;
  }
  put32(data, b << 16U | a);
  put_chunk(file, "IDAT", data);
  put_chunk(file, "IEND", {});
  return file;
}

Bytes bytes_of(std::initializer_list<int> values) {
  Bytes bytes;
  for (const int value : values) bytes.push_back(static_cast<std::byte>(value));
  return bytes;
}

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

TEST(ImageIo, SizesPastTheLimitAreRefusedByTheHeaderAlone) {
  // 40 GB of pixels that are not there: decoding them would be another error, allocating them would end the test.
  EXPECT_EQ(decode_code(make_png(100000, 100000, 8, 6, {})), ExitCode::Limit);
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
