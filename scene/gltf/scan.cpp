#include "scene/gltf/scan.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <unordered_set>
#include <vector>

#include "core/file.h"
#include "core/text.h"

namespace hpr {
namespace {

constexpr std::size_t kHeaderBytes = 12;
constexpr std::size_t kChunkHeaderBytes = 8;
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;
constexpr std::uint32_t kBinChunk = 0x004E4942;

std::uint32_t little_endian_32(std::span<const std::byte> bytes, std::size_t offset) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value |= std::to_integer<std::uint32_t>(bytes[offset + i]) << (8 * i);
  return value;
}

std::string_view as_text(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

constexpr std::string_view kDamaged = "the file is damaged or incomplete; export or copy it again";

struct GlbChunk {
  std::uint32_t type = 0;
  std::span<const std::byte> body;
};

/// Whether `rest` starts with a chunk. What it starts with else would be ignored were it whole: chunks of types that
/// glTF does not know are, and a file that was cut off is shorter than its header says.
bool starts_chunk(std::span<const std::byte> rest) {
  if (rest.size() < kChunkHeaderBytes) return false;
  const std::uint32_t type = little_endian_32(rest, 4);
  return type == kJsonChunk || type == kBinChunk || little_endian_32(rest, 0) <= rest.size() - kChunkHeaderBytes;
}

/// The chunk that starts `rest`, which becomes what follows it.
GlbChunk take_chunk(std::span<const std::byte>& rest, const std::string& where, GltfContext& context) {
  if (rest.size() < kChunkHeaderBytes) context.fail(where, "its header is cut off", kDamaged);
  const std::size_t size = little_endian_32(rest, 0);
  const std::uint32_t type = little_endian_32(rest, 4);
  rest = rest.subspan(kChunkHeaderBytes);
  if (size > rest.size()) {
    context.fail(where, fmt::format("{} bytes in a file that has {} left", size, rest.size()), kDamaged);
  }
  if (size % 4 != 0) context.warn(where, "its length is no multiple of four");
  const auto body = rest.first(size);
  rest = rest.subspan(size);
  return {type, body};
}

/// The chunks of a file as its header, which is checked, declares them.
std::span<const std::byte> check_header(std::span<const std::byte> file, GltfContext& context) {
  if (file.size() < kHeaderBytes)
    context.fail("header", fmt::format("{} bytes are no binary glTF", file.size()), kDamaged);
  const std::uint32_t version = little_endian_32(file, 4);
  if (version != 2) context.fail("header", fmt::format("glTF version {}", version), "convert the scene to glTF 2.0");
  const std::uint32_t length = little_endian_32(file, 8);
  if (length < kHeaderBytes || length > file.size()) {
    context.fail("header", fmt::format("it tells of {} bytes, the file has {}", length, file.size()), kDamaged);
  }
  if (length < file.size()) {
    context.warn("header", fmt::format("{} bytes follow the {} it tells of; ignored", file.size() - length, length));
  }
  return file.first(length).subspan(kHeaderBytes);
}

GltfParts split_glb(std::span<const std::byte> file, GltfContext& context) {
  GltfParts parts;
  bool has_json = false;
  std::span<const std::byte> rest = check_header(file, context);
  for (int chunk = 0; !rest.empty(); ++chunk) {
    const std::string where = fmt::format("chunk {}", chunk);
    if (chunk > 0 && !starts_chunk(rest)) {
      context.warn(where, fmt::format("{} bytes that are no chunk; ignored", rest.size()));
      break;
    }
    const auto [type, body] = take_chunk(rest, where, context);
    if (chunk == 0) {
      if (type != kJsonChunk) context.fail(where, "the first chunk must be JSON", kDamaged);
      parts.json = as_text(body);
      has_json = true;
    } else if (type == kJsonChunk) {
      context.warn(where, "a second JSON chunk is ignored");
    } else if (type == kBinChunk) {
      if (parts.has_binary) {
        context.warn(where, "a second BIN chunk is ignored");
      } else {
        if (chunk != 1) context.warn(where, "the BIN chunk should be the second");
        parts.binary = body;
        parts.has_binary = true;
      }
    }
  }
  if (!has_json) context.fail("", "the file has no JSON chunk", kDamaged);
  return parts;
}

/// The bytes of the UTF-8 sequence that starts `text`, 0 where there is none (overlong, surrogate, cut).
std::size_t utf8_length(std::string_view text) {
  const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U; };
  const auto continues = [&](std::size_t i) { return (byte(i) & 0xC0U) == 0x80U; };
  const unsigned first = byte(0);
  if (first < 0x80U) return 1;
  if (first >= 0xC2U && first <= 0xDFU) return continues(1) ? 2 : 0;
  if ((first & 0xF0U) == 0xE0U) {
    const bool overlong = first == 0xE0U && byte(1) < 0xA0U;
    const bool surrogate = first == 0xEDU && byte(1) >= 0xA0U;
    return continues(1) && continues(2) && !overlong && !surrogate ? 3 : 0;
  }
  if (first >= 0xF0U && first <= 0xF4U) {
    const bool overlong = first == 0xF0U && byte(1) < 0x90U;
    const bool beyond = first == 0xF4U && byte(1) >= 0x90U;
    return continues(1) && continues(2) && continues(3) && !overlong && !beyond ? 4 : 0;
  }
  return 0;
}

/// Names lines of a text, for offsets that never go back: it counts on from the last one, as a hostile file may give
/// cause for a million complaints.
class LineCounter {
 public:
  explicit LineCounter(std::string_view text) : text_(text) {}

  std::string at(std::size_t offset) {
    line_ += static_cast<std::size_t>(std::ranges::count(text_.substr(counted_, offset - counted_), '\n'));
    counted_ = offset;
    return fmt::format("line {}", line_);
  }

 private:
  std::string_view text_;
  std::size_t counted_ = 0;
  std::size_t line_ = 1;
};

/// Where the string that starts at `start` ends: its closing quote, or past the text.
std::size_t end_of_string(std::string_view json, std::size_t start, LineCounter& lines, GltfContext& context) {
  std::size_t i = start;
  while (i < json.size() && json[i] != '"') {
    if (json[i] == '\\') {
      i += 2;
      continue;
    }
    const std::size_t length = utf8_length(json.substr(i));
    if (length == 0) context.fail(lines.at(i), "the text is not UTF-8", "save the file as UTF-8");
    i += length;
  }
  return i;
}

}  // namespace

void scan_json(std::string_view json, GltfContext& context) {
  // One entry per open array or object: the keys so far (objects only), as they are written.
  struct Level {
    bool object = false;
    std::unordered_set<std::string_view> keys;
  };
  std::vector<Level> levels;
  bool key_follows = false;
  LineCounter lines(json);

  for (std::size_t i = 0; i < json.size(); ++i) {
    switch (json[i]) {
      case '{':
      case '[':
        if (levels.size() == kGltfJsonDepth) {
          context.fail(lines.at(i), fmt::format("the JSON nests deeper than {} levels", kGltfJsonDepth),
                       "remove the nesting; glTF needs about ten levels");
        }
        key_follows = json[i] == '{';
        levels.push_back({key_follows, {}});
        break;
      case '}':
      case ']':
        if (!levels.empty()) levels.pop_back();
        key_follows = false;
        break;
      case ',':
        key_follows = !levels.empty() && levels.back().object;
        break;
      case '"': {
        const std::size_t start = i + 1;
        i = end_of_string(json, start, lines, context);
        if (i >= json.size()) return;  // the parser says that the string has no end
        const std::string_view text = json.substr(start, i - start);
        if (key_follows && !levels.back().keys.insert(text).second) {
          context.warn(lines.at(i), fmt::format("the key \"{}\" stands twice in one object", printable(text)));
        }
        key_follows = false;
        break;
      }
      default:
        break;
    }
  }
}

GltfParts scan_gltf(std::span<const std::byte> file, GltfContext& context) {
  constexpr std::array<char, 4> kMagic{'g', 'l', 'T', 'F'};
  const bool binary = file.size() >= kMagic.size() && std::memcmp(file.data(), kMagic.data(), kMagic.size()) == 0;
  GltfParts parts = binary ? split_glb(file, context) : GltfParts{as_text(file), {}, false};

  const std::string_view text = without_mark(parts.json);
  if (text.size() < parts.json.size()) context.warn("", "the text starts with a byte order mark");
  parts.json = text;
  const std::size_t first = parts.json.find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos || parts.json[first] != '{') {
    context.fail("", "this is no glTF: it starts neither with \"glTF\" nor with a JSON object",
                 "HPR reads .gltf and .glb files");
  }
  scan_json(parts.json, context);
  return parts;
}

GltfFile open_gltf(const std::filesystem::path& path, GltfContext& context) {
  const SceneLimits& limits = context.limits();
  GltfFile file;
  if (context.reads_in_parts()) {
    file.bytes = map_file(path, std::numeric_limits<std::uint64_t>::max());  // it takes no memory
  } else {
    file.bytes = read_file(path, std::min(limits.file_bytes, limits.memory_bytes));
    context.charge(file.bytes.bytes().size(), "the file");
  }
  file.parts = scan_gltf(file.bytes.bytes(), context);
  // A parsed document takes up to some twenty times its text, and is held twice for a moment.
  context.check_room(std::uint64_t{file.parts.json.size()} * 16, "the JSON text");
  return file;
}

}  // namespace hpr
