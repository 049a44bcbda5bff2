#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "image/key.h"
#include "image/tiles.h"

/// Tiles as bytes, for messages between ranks of one run of HPR (never for files: the byte order is the machine's).
///
///   8 bytes            how the pixels are written (TileEncoding)
///   8 ceil(n / 64)     one bit per tile of the list, the lowest first: is it active? The bits past the last are 0
///   4096 pixels        of every active tile, in order of the list
///
/// The list of tiles itself does not travel: sender and receiver both know it.
namespace hpr {

enum class TileEncoding : std::uint64_t {
  WholeTiles = 0,  ///< all pixels of every active tile
};

/// What an encoded run says before its pixels.
struct EncodedTiles {
  std::vector<bool> active;           ///< per tile of the list
  std::span<const std::byte> pixels;  ///< of the active tiles, one after the other
};

/// Checks the encoding, the bits and the length of `bytes` for a list of `tiles` tiles whose pixels take `pixel_bytes`
/// each. Throws Error (Internal): a rank that sends nonsense is a fault of the program.
[[nodiscard]] EncodedTiles parse_encoded(std::span<const std::byte> bytes, std::size_t tiles, std::size_t pixel_bytes);

/// Appends the encoding's head for tiles of which `active` are, and reserves room for their pixels.
void append_head(std::vector<std::byte>& bytes, const std::vector<bool>& active, std::size_t pixel_bytes);

/// Appends `tiles` of `layer`. `bytes` holds a multiple of 8 when the keys in it are to be merged where they lie.
template <typename Pixel>
void append_tiles(std::vector<std::byte>& bytes, const TileLayer<Pixel>& layer, std::span<const std::size_t> tiles) {
  std::vector<bool> active(tiles.size());
  for (std::size_t i = 0; i < tiles.size(); ++i) active[i] = layer.active(tiles[i]);
  append_head(bytes, active, sizeof(Pixel));
  for (const std::size_t tile : tiles) {
    if (!layer.active(tile)) continue;
    const auto pixels = std::as_bytes(layer.tile(tile));
    bytes.insert(bytes.end(), pixels.begin(), pixels.end());
  }
}

/// The bytes of `tiles` of `layer`.
template <typename Pixel>
[[nodiscard]] std::vector<std::byte> encode_tiles(const TileLayer<Pixel>& layer, std::span<const std::size_t> tiles) {
  std::vector<std::byte> bytes;
  append_tiles(bytes, layer, tiles);
  return bytes;
}

/// Makes `tiles` of `layer` what they were where encode_tiles was called; tiles that were empty there become empty.
template <typename Pixel>
void decode_tiles(TileLayer<Pixel>& layer, std::span<const std::size_t> tiles, std::span<const std::byte> bytes) {
  const EncodedTiles encoded = parse_encoded(bytes, tiles.size(), sizeof(Pixel));
  const std::byte* next = encoded.pixels.data();
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    if (!encoded.active[i]) {
      layer.clear(tiles[i]);
      continue;
    }
    const std::span<Pixel> pixels = layer.tile(tiles[i]);
    std::memcpy(pixels.data(), next, pixels.size_bytes());
    layer.set_active(tiles[i]);
    next += pixels.size_bytes();
  }
}

/// Merges encoded keys into `tiles` of `layer`, reading them where they lie: `bytes` starts at a multiple of 8, as
/// every message in a vector does.
void merge_encoded(TileLayer<Key>& layer, std::span<const std::size_t> tiles, std::span<const std::byte> bytes);

}  // namespace hpr
