#include <zlib.h>

#include <algorithm>
#include <cstring>

#include "core/error.h"
#include "image/image_io.h"
#include "tests/fuzz/fuzz.h"

// Textures, environments and pictures to compare: PNG, JPEG, EXR and Radiance, as textures and as floats.
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

void put_big_endian(std::uint32_t value, std::byte* bytes) {
  value = __builtin_bswap32(value);
  std::memcpy(bytes, &value, sizeof(value));
}

std::uint32_t crc_of(const std::byte* bytes, std::size_t count) {
  return static_cast<std::uint32_t>(
      ::crc32(0, reinterpret_cast<const unsigned char*>(bytes), static_cast<unsigned>(count)));
}

Bytes chunk(std::string_view type, const Bytes& data) {
  Bytes bytes(kChunkHead + data.size() + kCrc);
  put_big_endian(static_cast<std::uint32_t>(data.size()), bytes.data());
  std::memcpy(bytes.data() + 4, type.data(), 4);
  std::ranges::copy(data, bytes.begin() + kChunkHead);
  put_big_endian(crc_of(bytes.data() + 4, data.size() + 4), bytes.data() + kChunkHead + data.size());
  return bytes;
}

/// A PNG of zeros, and the chunks that few files have.
Bytes png_of(int bits, int color_type, int interlaced, const std::vector<Bytes>& extra) {
  const std::string_view start("\x89PNG\r\n\x1A\n", kPngStart);
  Bytes file = to_bytes(start);
  Bytes header(13);
  put_big_endian(9, header.data());
  put_big_endian(7, header.data() + 4);
  header[8] = static_cast<std::byte>(bits);
  header[9] = static_cast<std::byte>(color_type);
  header[12] = static_cast<std::byte>(interlaced);
  const auto add = [&](const Bytes& bytes) { file.insert(file.end(), bytes.begin(), bytes.end()); };
  add(chunk("IHDR", header));
  for (const Bytes& one : extra) add(one);
  const Bytes raw(1000);
  Bytes packed(2000);
  unsigned long size = packed.size();
  ::compress(reinterpret_cast<unsigned char*>(packed.data()), &size, reinterpret_cast<const unsigned char*>(raw.data()),
             raw.size());
  packed.resize(size);
  add(chunk("IDAT", packed));
  add(chunk("IEND", {}));
  return file;
}

/// A JPEG of 16 x 16 pixels, the first component twice as fine as others.
Bytes jpeg(int components) {
  Bytes file = to_bytes(std::string_view("\xFF\xD8\xFF\xDB\0\x43\0", 7));
  file.insert(file.end(), 64, std::byte{1});
  const auto add = [&](std::initializer_list<int> values) {
    for (const int value : values) file.push_back(static_cast<std::byte>(value));
  };
  add({0xFF, 0xC0, 0, 8 + 3 * components, 8, 0, 16, 0, 16, components});
  for (int i = 1; i <= components; ++i) add({i, i == 1 ? 0x22 : 0x11, 0});
  add({0xFF, 0xC4, 0, 31, 0, 0, 0, 0, 12, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11});
  add({0xFF, 0xC4, 0, 20, 0x10, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  add({0xFF, 0xDA, 0, 6 + 2 * components, components});
  for (int i = 1; i <= components; ++i) add({i, 0});
  add({0, 63, 0});
  // Blocks of five bits, all zeros, four of the first component and one of each other, and ones up to the next byte.
  const int bits = 5 * (3 + components);
  for (int bit = 0; bit < bits; bit += 8) add({bit + 8 <= bits ? 0 : 0xFF >> (bits - bit)});
  add({0xFF, 0xD9});
  return file;
}

}  // namespace

std::vector<Bytes> seeds() {
  const Bytes profile = to_bytes(std::string_view("p\0\0\x78\x01\x01\4\0\xFB\xFF\0\0\0\x80", 14));
  const Bytes palette(12, std::byte{9});
  std::vector<Bytes> all{
      png_of(8, 6, 0, {chunk("iCCP", profile), chunk("gAMA", Bytes(4)), chunk("tEXt", to_bytes("a"))}),
      png_of(2, 3, 1, {chunk("PLTE", palette), chunk("tRNS", Bytes(4)), chunk("bKGD", Bytes(1))}),
      png_of(16, 2, 1, {chunk("tRNS", Bytes(6)), chunk("eXIf", Bytes(20)), chunk("sPLT", Bytes(20))}),
      png_of(1, 0, 0, {chunk("zTXt", profile), chunk("iTXt", profile)}),
      png_of(16, 4, 0, {}),
      jpeg(1),
      jpeg(3),
      jpeg(4)};
  Bytes radiance = to_bytes("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=1\n\n-Y 2 +X 9\n");
  for (const int line : {0, 1}) {
    for (const int value : {2, 2, 0, 9, 0x89, 1, 0x89, 2, 0x89, 3 + line, 0x89, 0x81})
      radiance.push_back(static_cast<std::byte>(value));
  }
  all.push_back(radiance);
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
    put_big_endian(crc_of(input.data() + at + 4, length + 4), input.data() + at + kChunkHead + length);
    at += kChunkHead + length + kCrc;
  }
  return input;
}

}  // namespace hpr::fuzz
