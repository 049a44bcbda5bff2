#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <initializer_list>
#include <span>
#include <string_view>
#include <vector>

/// Picture files for tests, made by their specifications rather than by the libraries that are to read them.
namespace hpr::test {

using Bytes = std::vector<std::byte>;

inline void put32(Bytes& out, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8)
    out.push_back(static_cast<std::byte>(value >> static_cast<unsigned>(shift)));
}

inline std::uint32_t crc32(std::span<const std::byte> bytes) {
  std::uint32_t crc = ~0U;
  for (const std::byte byte : bytes) {
    crc ^= static_cast<std::uint32_t>(byte);
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1U ^ ((crc & 1U) != 0 ? 0xEDB88320U : 0U);
  }
  return ~crc;
}

inline void put_chunk(Bytes& out, std::string_view type, const Bytes& data) {
  put32(out, static_cast<std::uint32_t>(data.size()));
  Bytes body(type.size() + data.size());
  std::memcpy(body.data(), type.data(), type.size());
  if (!data.empty()) std::memcpy(body.data() + type.size(), data.data(), data.size());
  out.insert(out.end(), body.begin(), body.end());
  put32(out, crc32(body));
}

struct Chunk {
  std::string_view type;
  Bytes data;
};

/// A PNG file by its specification (ISO/IEC 15948), with uncompressed data. `rows`: each with its filter byte, of an
/// interlaced picture pass by pass. `chunks` stand before the data.
inline Bytes make_png(std::uint32_t width, std::uint32_t height, int bits, int color_type,
                      const std::vector<Bytes>& rows, const std::vector<Chunk>& chunks = {}, int interlaced = 0) {
  Bytes file;
  for (const int b : {0x89, 0x50, 0x4E, 0x47, 0x0D, 0x0A, 0x1A, 0x0A}) file.push_back(static_cast<std::byte>(b));
  Bytes header;
  put32(header, width);
  put32(header, height);
  for (const int b : {bits, color_type, 0, 0, interlaced}) header.push_back(static_cast<std::byte>(b));
  put_chunk(file, "IHDR", header);
  for (const Chunk& chunk : chunks) put_chunk(file, chunk.type, chunk.data);

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

inline Bytes bytes_of(std::initializer_list<int> values) {
  Bytes bytes;
  for (const int value : values) bytes.push_back(static_cast<std::byte>(value));
  return bytes;
}

/// A baseline JPEG file by its specification (ITU-T T.81) of 8 x 8 pixels, each component of one level, with quantizers
/// of 1: decoders have nothing to round. `segments`: bytes of markers, put before the frame.
inline Bytes make_jpeg(const std::vector<int>& levels, const Bytes& segments = {}) {
  Bytes file = bytes_of({0xFF, 0xD8});
  file.insert(file.end(), segments.begin(), segments.end());
  const auto put = [&](std::initializer_list<int> values) {
    const Bytes bytes = bytes_of(values);
    file.insert(file.end(), bytes.begin(), bytes.end());
  };
  const int count = static_cast<int>(levels.size());
  put({0xFF, 0xDB, 0, 67, 0});
  file.insert(file.end(), 64, std::byte{1});
  put({0xFF, 0xC0, 0, 8 + 3 * count, 8, 0, 8, 0, 8, count});
  for (int i = 1; i <= count; ++i) put({i, 0x11, 0});
  // Lengths of first coefficients have codes of 4 bits each, the end of a block has one of 1 bit.
  put({0xFF, 0xC4, 0, 31, 0, 0, 0, 0, 12, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11});
  put({0xFF, 0xC4, 0, 20, 0x10, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  put({0xFF, 0xDA, 0, 6 + 2 * count, count});
  for (int i = 1; i <= count; ++i) put({i, 0});
  put({0, 63, 0});
  unsigned bits = 0;
  int filled = 0;
  const auto put_bits = [&](unsigned value, int length) {
    for (int bit = length - 1; bit >= 0; --bit) {
      bits = bits << 1U | (value >> static_cast<unsigned>(bit) & 1U);
      if (++filled % 8 != 0) continue;
      put({static_cast<int>(bits & 0xFFU)});
      if ((bits & 0xFFU) == 0xFFU) put({0});
    }
  };
  for (const int level : levels) {
    const int first = 8 * (level - 128);
    const auto length = static_cast<int>(std::bit_width(static_cast<unsigned>(std::abs(first))));
    put_bits(static_cast<unsigned>(length), 4);
    put_bits(static_cast<unsigned>(first < 0 ? first + (1 << length) - 1 : first), length);
    put_bits(0, 1);
  }
  while (filled % 8 != 0) put_bits(1, 1);
  put({0xFF, 0xD9});
  return file;
}

inline Bytes adobe_marker(int transform) {
  return bytes_of({0xFF, 0xEE, 0, 14, 'A', 'd', 'o', 'b', 'e', 0, 100, 0, 0, 0, 0, transform});
}

}  // namespace hpr::test
