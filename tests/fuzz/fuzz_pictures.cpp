#include <webp/encode.h>

#include <array>
#include <cstring>

#include "core/error.h"
#include "image/image_io.h"
#include "image/test_files.h"
#include "tests/fuzz/fuzz.h"

// Textures, environments and pictures to compare: PNG, JPEG, WebP, EXR and Radiance, as textures and as floats.
namespace hpr::fuzz {
namespace {

constexpr std::size_t kPngStart = 8;
constexpr std::size_t kChunkHead = 8;  ///< length and type
constexpr std::size_t kCrc = 4;

std::uint32_t big_endian(const std::byte* bytes) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes, sizeof(value));
  return __builtin_bswap32(value);
}

/// A PNG of zeros, and of the chunks that few files have.
Bytes png_of(int bits, int color_type, int interlaced, const std::vector<test::Chunk>& chunks) {
  return test::make_png(9, 7, bits, color_type, {Bytes(1000)}, chunks, interlaced);
}

/// A WebP picture; past a quality of 100 without loss.
Bytes webp_of(float quality) {
  constexpr int kWidth = 19;
  constexpr int kHeight = 17;
  constexpr int kStride = kWidth * 4;
  std::array<std::uint8_t, std::size_t{kStride} * kHeight> levels{};
  for (std::size_t i = 0; i < levels.size(); ++i) levels.at(i) = static_cast<std::uint8_t>(i * i / 7);
  std::uint8_t* out = nullptr;
  const std::size_t size = quality > 100.0F ? WebPEncodeLosslessRGBA(levels.data(), kWidth, kHeight, kStride, &out)
                                            : WebPEncodeRGBA(levels.data(), kWidth, kHeight, kStride, quality, &out);
  const auto bytes = std::as_bytes(std::span(out, size));
  Bytes copy(bytes.begin(), bytes.end());
  WebPFree(out);
  return copy;
}

}  // namespace

std::vector<Bytes> seeds() {
  const Bytes profile = to_bytes(std::string_view("p\0\0\x78\x01\x01\4\0\xFB\xFF\0\0\0\x80", 14));
  const Bytes palette(12, std::byte{9});
  std::vector<Bytes> all{png_of(8, 6, 0, {{"iCCP", profile}, {"gAMA", Bytes(4)}, {"tEXt", to_bytes("a")}}),
                         png_of(2, 3, 1, {{"PLTE", palette}, {"tRNS", Bytes(4)}, {"bKGD", Bytes(1)}}),
                         png_of(16, 2, 1, {{"tRNS", Bytes(6)}, {"eXIf", Bytes(20)}, {"sPLT", Bytes(20)}}),
                         png_of(1, 0, 0, {{"zTXt", profile}, {"iTXt", profile}}),
                         png_of(16, 4, 0, {}),
                         test::make_jpeg({77}),
                         test::make_jpeg({200, 100, 7}),
                         test::make_jpeg({255, 128, 51, 255}, test::adobe_marker(0))};
  Bytes radiance = to_bytes("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=1\n\n-Y 2 +X 9\n");
  for (const int line : {0, 1}) {
    for (const int value : {2, 2, 0, 9, 0x89, 1, 0x89, 2, 0x89, 3 + line, 0x89, 0x81})
      radiance.push_back(static_cast<std::byte>(value));
  }
  all.push_back(radiance);
  for (const float quality : {0.0F, 90.0F, 101.0F}) all.push_back(webp_of(quality));
  const Image<Rgb> picture({9, 7}, {0.5F, 1.0F, 2.0F});
  all.push_back(encode_exr(picture, {{"note", "text"}}));
  all.push_back(encode_exr(picture, {}, std::vector<ExrLayer>{{{"id.X"}, {}, std::vector<std::uint32_t>(63)}}));
  return all;
}

bool run(std::span<const std::byte> input) {
  const ImageLimits limits{.side = 4096, .pixels = 1U << 20U};
  try {
    (void)decode_image(input, "texture", limits);
  } catch (const Error& error) {
    if (error.code() == ExitCode::Internal) throw;  // a fault of the program's
  }
  try {
    (void)decode_float_image(input, "picture", limits);
    return true;
  } catch (const Error& error) {
    if (error.code() == ExitCode::Internal) throw;  // a fault of the program's
    return false;
  }
}

/// Of PNG the sums of its chunks.
Bytes repaired(Bytes input) {
  constexpr std::string_view kPng = "\x89PNG";
  if (input.size() < kPngStart || std::memcmp(input.data(), kPng.data(), kPng.size()) != 0) return input;
  for (std::size_t at = kPngStart; at + kChunkHead + kCrc <= input.size();) {
    const std::size_t length = big_endian(input.data() + at);
    if (length > input.size() - at - kChunkHead - kCrc) break;
    const std::uint32_t sum = __builtin_bswap32(test::crc32(std::span(input).subspan(at + 4, length + 4)));
    std::memcpy(input.data() + at + kChunkHead + length, &sum, sizeof(sum));
    at += kChunkHead + length + kCrc;
  }
  return input;
}

}  // namespace hpr::fuzz
