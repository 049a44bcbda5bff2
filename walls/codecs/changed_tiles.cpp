#include "walls/codecs/changed_tiles.h"

#include <algorithm>

#include "core/error.h"
#include "walls/codecs/coder.h"
#include "walls/codecs/pixel_planes.h"

namespace hpr {
namespace {

std::size_t across(Size picture) {
  return static_cast<std::size_t>((picture.width + kDeltaSide - 1) / kDeltaSide);
}

std::size_t down(Size picture) {
  return static_cast<std::size_t>((picture.height + kDeltaSide - 1) / kDeltaSide);
}

/// Where tile `index` lies in a picture.
Rect place_of(std::size_t index, Size picture) {
  const int x = static_cast<int>(index % across(picture)) * kDeltaSide;
  const int y = static_cast<int>(index / across(picture)) * kDeltaSide;
  return {x, y, std::min(x + kDeltaSide, picture.width), std::min(y + kDeltaSide, picture.height)};
}

template <typename Pixel>
std::span<Pixel> part(std::span<Pixel> row, int from, int count) {
  return row.subspan(static_cast<std::size_t>(from), static_cast<std::size_t>(count));
}

bool differs(const Image<Rgba8>& before, const Image<Rgba8>& now, const Rect& place, int error) {
  for (int y = place.y0; y < place.y1; ++y) {
    if (!all_within(part(before.row(y), place.x0, place.width()), part(now.row(y), place.x0, place.width()), error)) {
      return true;
    }
  }
  return false;
}

}  // namespace

std::size_t delta_tile_count(Size picture) {
  return across(picture) * down(picture);
}

std::vector<std::size_t> changed_tiles(const Image<Rgba8>& before, const Image<Rgba8>& now, int error) {
  HPR_CHECK(before.size() == now.size());
  std::vector<std::size_t> changed;
  for (std::size_t tile = 0; tile < delta_tile_count(now.size()); ++tile) {
    if (differs(before, now, place_of(tile, now.size()), error)) changed.push_back(tile);
  }
  return changed;
}

Size packed_size(Size picture, std::size_t tiles) {
  // No wider than the picture, so that what a codec takes as a picture it takes as tiles.
  const std::size_t columns = std::min(tiles, across(picture));
  if (columns == 0) return {};
  const std::size_t rows = (tiles + columns - 1) / columns;
  return {static_cast<int>(columns) * kDeltaSide, static_cast<int>(rows) * kDeltaSide};
}

Image<Rgba8> pack_tiles(const Image<Rgba8>& picture, std::span<const std::size_t> tiles) {
  Image<Rgba8> packed(packed_size(picture.size(), tiles.size()));
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const Rect from = place_of(tiles[i], picture.size());
    const Rect into = place_of(i, packed.size());
    for (int y = 0; y < from.height(); ++y) {
      std::ranges::copy(part(picture.row(from.y0 + y), from.x0, from.width()),
                        part(packed.row(into.y0 + y), into.x0, from.width()).begin());
    }
  }
  return packed;
}

void unpack_tiles(const Image<Rgba8>& packed, std::span<const std::size_t> tiles, Image<Rgba8>& picture) {
  HPR_CHECK(packed.size() == packed_size(picture.size(), tiles.size()));
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const Rect from = place_of(i, packed.size());
    const Rect into = place_of(tiles[i], picture.size());
    for (int y = 0; y < into.height(); ++y) {
      std::ranges::copy(part(packed.row(from.y0 + y), from.x0, into.width()),
                        part(picture.row(into.y0 + y), into.x0, into.width()).begin());
    }
  }
}

std::size_t tile_bits_size(Size picture) {
  return (delta_tile_count(picture) + 7) / 8;
}

void append_bits(std::span<const std::size_t> tiles, Size picture, std::vector<std::byte>& into) {
  const std::size_t start = into.size();
  into.resize(start + tile_bits_size(picture));
  for (const std::size_t tile : tiles) into[start + tile / 8] |= std::byte{1} << (tile % 8);
}

std::vector<std::size_t> read_bits(std::span<const std::byte> bytes, Size picture) {
  HPR_CHECK(bytes.size() == tile_bits_size(picture));
  std::vector<std::size_t> tiles;
  for (std::size_t bit = 0; bit < bytes.size() * 8; ++bit) {
    if ((bytes[bit / 8] & (std::byte{1} << (bit % 8))) == std::byte{0}) continue;
    if (bit >= delta_tile_count(picture)) throw_damaged("it names tiles the picture does not have");
    tiles.push_back(bit);
  }
  return tiles;
}

}  // namespace hpr
