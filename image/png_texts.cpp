#include "image/png_texts.h"

#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <string_view>

#include "core/error.h"

namespace hpr {
namespace {

constexpr std::size_t kSignatureBytes = 8;
constexpr std::size_t kWord = 4;
constexpr std::size_t kHeaderEnd = kSignatureBytes + kWord + kWord + 13 + kWord;  // past IHDR
constexpr std::string_view kText = "tEXt";

void put_word(std::vector<std::byte>& bytes, std::uint32_t word) {
  for (const unsigned shift : {24U, 16U, 8U, 0U}) bytes.push_back(static_cast<std::byte>(word >> shift & 0xFFU));
}

std::uint32_t word_at(std::span<const std::byte> bytes) {
  std::uint32_t word = 0;
  for (std::size_t i = 0; i < kWord; ++i) word = word << 8U | static_cast<std::uint32_t>(bytes[i]);
  return word;
}

std::string_view characters(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::vector<std::byte> chunk_of(const std::string& keyword, const std::string& text) {
  constexpr std::size_t kMaxKeyword = 79;
  HPR_CHECK(!keyword.empty() && keyword.size() <= kMaxKeyword);
  std::string body(kText);
  body.append(keyword).push_back('\0');
  body += text;
  std::vector<std::byte> chunk;
  put_word(chunk, static_cast<std::uint32_t>(body.size() - kText.size()));
  const auto bytes = std::as_bytes(std::span(body));
  chunk.insert(chunk.end(), bytes.begin(), bytes.end());
  put_word(chunk, static_cast<std::uint32_t>(
                      ::crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()))));
  return chunk;
}

}  // namespace

void add_png_texts(std::vector<std::byte>& png, const PngTexts& texts) {
  HPR_CHECK(png.size() > kHeaderEnd);
  std::vector<std::byte> chunks;
  for (const auto& [keyword, text] : texts) {
    const std::vector<std::byte> chunk = chunk_of(keyword, text);
    chunks.insert(chunks.end(), chunk.begin(), chunk.end());
  }
  png.insert(png.begin() + kHeaderEnd, chunks.begin(), chunks.end());
}

PngTexts png_texts(std::span<const std::byte> file) {
  PngTexts texts;
  if (file.size() <= kHeaderEnd) return texts;
  for (std::span<const std::byte> rest = file.subspan(kHeaderEnd); rest.size() >= 3 * kWord;) {
    const std::size_t length = word_at(rest);
    const std::string_view name = characters(rest.subspan(kWord, kWord));
    if (length > rest.size() - 3 * kWord || name == "IDAT") break;
    const std::string_view body = characters(rest.subspan(2 * kWord, length));
    const std::size_t end = body.find('\0');
    if (name == kText && end != std::string_view::npos) {
      texts.emplace(std::string(body.substr(0, end)), std::string(body.substr(end + 1)));
    }
    rest = rest.subspan(3 * kWord + length);
  }
  return texts;
}

}  // namespace hpr
