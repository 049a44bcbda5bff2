#include "compositing/tile_codec.h"

#include <fmt/format.h>

#include <algorithm>

#include "compositing/merge.h"
#include "core/check.h"
#include "core/error.h"

namespace hpr {
namespace {

using Word = std::uint64_t;
constexpr std::size_t kWordBits = 64;

std::size_t words_for(std::size_t tiles) {
  return (tiles + kWordBits - 1) / kWordBits;
}

[[noreturn]] void malformed(const std::string& what) {
  throw Error(ExitCode::Internal, "a message of tiles is malformed: " + what,
              "ranks of different builds cannot work together");
}

}  // namespace

void append_head(std::vector<std::byte>& bytes, const std::vector<bool>& active, std::size_t pixel_bytes) {
  std::vector<Word> head(1 + words_for(active.size()));
  head[0] = static_cast<Word>(TileEncoding::WholeTiles);
  std::size_t active_tiles = 0;
  for (std::size_t i = 0; i < active.size(); ++i) {
    if (!active[i]) continue;
    head[1 + i / kWordBits] |= Word{1} << (i % kWordBits);
    ++active_tiles;
  }
  const auto head_bytes = std::as_bytes(std::span(head));
  bytes.reserve(bytes.size() + head_bytes.size() + active_tiles * kTilePixels * pixel_bytes);
  bytes.insert(bytes.end(), head_bytes.begin(), head_bytes.end());
}

EncodedTiles parse_encoded(std::span<const std::byte> bytes, std::size_t tiles, std::size_t pixel_bytes) {
  std::vector<Word> head(1 + words_for(tiles));
  const std::size_t head_bytes = head.size() * sizeof(Word);
  if (bytes.size() < head_bytes) {
    malformed(
        fmt::format("{} bytes cannot hold the head of {} tiles, which takes {}", bytes.size(), tiles, head_bytes));
  }
  std::memcpy(head.data(), bytes.data(), head_bytes);
  if (head[0] != static_cast<Word>(TileEncoding::WholeTiles)) malformed(fmt::format("unknown encoding {}", head[0]));

  EncodedTiles encoded{std::vector<bool>(tiles), bytes.subspan(head_bytes)};
  std::size_t active_tiles = 0;
  for (std::size_t i = 0; i < words_for(tiles) * kWordBits; ++i) {
    if ((head[1 + i / kWordBits] >> (i % kWordBits) & 1U) == 0) continue;
    if (i >= tiles) malformed(fmt::format("tile {} of {} is said to be active", i, tiles));
    encoded.active[i] = true;
    ++active_tiles;
  }
  const std::size_t expected = active_tiles * kTilePixels * pixel_bytes;
  if (encoded.pixels.size() != expected) {
    malformed(fmt::format("{} active tiles take {} bytes, {} came", active_tiles, expected, encoded.pixels.size()));
  }
  return encoded;
}

void merge_encoded(TileLayer<Key>& layer, std::span<const std::size_t> tiles, std::span<const std::byte> bytes) {
  const EncodedTiles encoded = parse_encoded(bytes, tiles.size(), sizeof(Key));
  HPR_CHECK(reinterpret_cast<std::uintptr_t>(encoded.pixels.data()) % alignof(Key) == 0);
  const Key* next = reinterpret_cast<const Key*>(encoded.pixels.data());
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    if (!encoded.active[i]) continue;
    const std::span<const Key> arrived(next, kTilePixels);
    const std::size_t tile = tiles[i];
    // An empty tile takes what came; reading its zeros to merge with them would only touch fresh memory twice.
    if (layer.active(tile)) {
      merge_keys(layer.tile(tile), arrived);
    } else {
      std::ranges::copy(arrived, layer.tile(tile).begin());
      layer.set_active(tile);
    }
    next += kTilePixels;
  }
}

}  // namespace hpr
