#include "walls/codecs/stream_codec.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "core/bytes.h"
#include "core/error.h"
#include "walls/codecs/coder.h"

namespace hpr {
namespace {

std::uint64_t checksum_of(std::span<const std::byte> bytes) {
  ContentHash hash;
  hash.add(bytes.first(offsetof(Envelope, checksum)));
  hash.add(bytes.subspan(sizeof(Envelope)));
  return hash.value();
}

/// Squares of 64 pixels a side, row by row; those at the right and lower border may be smaller.
constexpr int kDeltaSide = 64;

std::size_t across(Size picture) {
  return static_cast<std::size_t>((picture.width + kDeltaSide - 1) / kDeltaSide);
}

std::size_t down(Size picture) {
  return static_cast<std::size_t>((picture.height + kDeltaSide - 1) / kDeltaSide);
}

/// Where tile `index` lies in a picture.
Rect rect_of(std::size_t index, Size picture) {
  const int x = static_cast<int>(index % across(picture)) * kDeltaSide;
  const int y = static_cast<int>(index / across(picture)) * kDeltaSide;
  return {x, y, std::min(x + kDeltaSide, picture.width), std::min(y + kDeltaSide, picture.height)};
}

template <typename Pixel>
std::span<Pixel> part(std::span<Pixel> row, int from, int count) {
  return row.subspan(static_cast<std::size_t>(from), static_cast<std::size_t>(count));
}

bool differs(const Image<Rgba8>& before, const Image<Rgba8>& now, const Rect& rect, int error) {
  for (int y = rect.y0; y < rect.y1; ++y) {
    if (!all_within(part(before.row(y), rect.x0, rect.width()), part(now.row(y), rect.x0, rect.width()), error)) {
      return true;
    }
  }
  return false;
}

struct Opened {
  Envelope envelope;
  std::span<const std::byte> payload;
};

/// Throws Error (BadInput) unless every bit is as it was sealed and the picture is of `size`.
Opened open_envelope(std::span<const std::byte> bytes, Size size) {
  if (bytes.size() < sizeof(Envelope)) throw_damaged(fmt::format("it has only {} bytes", bytes.size()));
  Envelope envelope;
  std::memcpy(&envelope, bytes.data(), sizeof(Envelope));
  const std::span<const std::byte> payload = bytes.subspan(sizeof(Envelope));
  if (envelope.magic != Envelope{}.magic) throw_damaged("it does not begin as one");
  if (envelope.version != Envelope{}.version) {
    throw Error(ExitCode::BadInput, fmt::format("an encoded picture is of version {}, not 1", envelope.version),
                "run the same version of hpr on all hosts");
  }
  if (envelope.payload_bytes != payload.size()) {
    throw_damaged(fmt::format("{} bytes follow, not {}", payload.size(), envelope.payload_bytes));
  }
  if (envelope.checksum != checksum_of(bytes)) throw_damaged("its checksum differs");
  if (Size{static_cast<int>(envelope.width), static_cast<int>(envelope.height)} != size) {
    throw Error(ExitCode::BadInput,
                fmt::format("an encoded picture is of {}x{} pixels, but {}x{} are expected", envelope.width,
                            envelope.height, size.width, size.height),
                "use the same wall file on both sides");
  }
  if (envelope.coder >= all_coders().size()) throw_damaged("its codec is unknown");
  return {envelope, payload};
}

std::size_t delta_tile_count(Size picture) {
  return across(picture) * down(picture);
}

/// Indices of the tiles of `now` with a pixel outside `error` of `before` (all_within); equal sizes.
std::vector<std::size_t> changed_tiles(const Image<Rgba8>& before, const Image<Rgba8>& now, int error) {
  HPR_CHECK(before.size() == now.size());
  std::vector<std::size_t> changed;
  for (std::size_t tile = 0; tile < delta_tile_count(now.size()); ++tile) {
    if (differs(before, now, rect_of(tile, now.size()), error)) changed.push_back(tile);
  }
  return changed;
}

/// The size of a picture that holds so many tiles of a picture side by side.
Size packed_size(Size picture, std::size_t tiles) {
  // No wider than the picture, so that what a codec takes as a picture it takes as tiles.
  const std::size_t columns = std::min(tiles, across(picture));
  if (columns == 0) return {};
  const std::size_t rows = (tiles + columns - 1) / columns;
  return {static_cast<int>(columns) * kDeltaSide, static_cast<int>(rows) * kDeltaSide};
}

/// These tiles side by side; what they do not fill is 0.
Image<Rgba8> pack_tiles(const Image<Rgba8>& picture, std::span<const std::size_t> tiles) {
  Image<Rgba8> packed(packed_size(picture.size(), tiles.size()));
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const Rect from = rect_of(tiles[i], picture.size());
    const Rect into = rect_of(i, packed.size());
    for (int y = 0; y < from.height(); ++y) {
      std::ranges::copy(part(picture.row(from.y0 + y), from.x0, from.width()),
                        part(packed.row(into.y0 + y), into.x0, from.width()).begin());
    }
  }
  return packed;
}

/// Puts the tiles of a packed picture back into their places.
void unpack_tiles(const Image<Rgba8>& packed, std::span<const std::size_t> tiles, Image<Rgba8>& picture) {
  HPR_CHECK(packed.size() == packed_size(picture.size(), tiles.size()));
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const Rect from = rect_of(i, packed.size());
    const Rect into = rect_of(tiles[i], picture.size());
    for (int y = 0; y < into.height(); ++y) {
      std::ranges::copy(part(packed.row(from.y0 + y), from.x0, into.width()),
                        part(picture.row(into.y0 + y), into.x0, into.width()).begin());
    }
  }
}

/// Bytes of one bit per tile.
std::size_t tile_bits_size(Size picture) {
  return (delta_tile_count(picture) + 7) / 8;
}

/// Appends one bit per tile, set for `tiles`.
void append_bits(std::span<const std::size_t> tiles, Size picture, std::vector<std::byte>& into) {
  const std::size_t start = into.size();
  into.resize(start + tile_bits_size(picture));
  for (const std::size_t tile : tiles) into[start + tile / 8] |= std::byte{1} << (tile % 8);
}

/// The tiles whose bits are set in what append_bits() appended. Throws Error (BadInput) for bits past the last tile.
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

}  // namespace

void throw_damaged(std::string_view what) {
  throw Error(ExitCode::BadInput, fmt::format("an encoded picture is damaged: {}", what), "have the sender restart");
}

void seal(Envelope& envelope, std::vector<std::byte>& bytes) {
  HPR_CHECK(bytes.size() >= sizeof(Envelope));
  envelope.payload_bytes = bytes.size() - sizeof(Envelope);
  std::memcpy(bytes.data(), &envelope, sizeof(Envelope));
  envelope.checksum = checksum_of(bytes);
  std::memcpy(bytes.data(), &envelope, sizeof(Envelope));
}

StreamCodec::StreamCodec(std::size_t coder, const CodecSettings& settings)
    : own_(coder), settings_(settings), coders_(all_coders().size()) {}

std::string_view StreamCodec::name() const {
  return all_coders()[own_].name;
}

std::vector<std::byte> StreamCodec::encode(const Image<Rgba8>& picture) {
  Envelope envelope{.coder = static_cast<std::uint8_t>(own_),
                    .error = static_cast<std::uint8_t>(settings_.error),
                    .width = static_cast<std::uint32_t>(picture.width()),
                    .height = static_cast<std::uint32_t>(picture.height()),
                    .number = ++encoded_};
  std::vector<std::byte> bytes(sizeof(Envelope));
  const bool follows = settings_.deltas && sent_.known && sent_.picture.size() == picture.size();
  const std::vector<std::size_t> changed =
      follows ? changed_tiles(sent_.picture, picture, settings_.error) : std::vector<std::size_t>();
  if (settings_.deltas) envelope.flags |= Envelope::kKeep;
  if (follows && changed.size() < delta_tile_count(picture.size())) {
    envelope.flags |= Envelope::kTiles;
    envelope.base = sent_.checksum;
    sent_.known = false;  // until the whole message stands
    encode_tiles(picture, changed, bytes);
  } else {
    sent_.known = false;
    encode_whole(picture, bytes);
  }
  seal(envelope, bytes);
  sent_.checksum = envelope.checksum;
  sent_.known = settings_.deltas;
  return bytes;
}

void StreamCodec::encode_whole(const Image<Rgba8>& picture, std::vector<std::byte>& bytes) {
  if (picture.pixels().empty()) {
    sent_.picture = picture;
    return;
  }
  const bool wants_seen = settings_.deltas && settings_.error > 0;
  coder(own_).encode(picture, bytes, wants_seen ? &sent_.picture : nullptr);
  if (settings_.deltas && !wants_seen) sent_.picture = picture;
}

void StreamCodec::encode_tiles(const Image<Rgba8>& picture, std::span<const std::size_t> tiles,
                               std::vector<std::byte>& bytes) {
  append_bits(tiles, picture.size(), bytes);
  if (tiles.empty()) return;
  const Image<Rgba8> packed = pack_tiles(picture, tiles);
  Image<Rgba8> seen;
  coder(own_).encode(packed, bytes, settings_.error > 0 ? &seen : nullptr);
  unpack_tiles(settings_.error > 0 ? seen : packed, tiles, sent_.picture);
}

void StreamCodec::decode(std::span<const std::byte> bytes, Image<Rgba8>& picture) {
  const Opened opened = open_envelope(bytes, picture.size());
  const Envelope& envelope = opened.envelope;
  if ((envelope.flags & ~(Envelope::kTiles | Envelope::kKeep)) != 0) throw_damaged("its flags are unknown");
  if (envelope.has(Envelope::kTiles)) {
    decode_tiles(envelope, opened.payload, picture);
  } else if (!picture.pixels().empty()) {
    coder(envelope.coder).decode(opened.payload, envelope.error, picture);
  } else if (!opened.payload.empty()) {
    throw_damaged("it has no pixels, but bytes");
  }
  received_.known = envelope.has(Envelope::kKeep);
  if (received_.known && !envelope.has(Envelope::kTiles)) received_.picture = picture;
  received_.checksum = envelope.checksum;
  received_.number = envelope.number;
}

void StreamCodec::decode_tiles(const Envelope& envelope, std::span<const std::byte> payload, Image<Rgba8>& picture) {
  if (!received_.known || received_.checksum != envelope.base || received_.picture.size() != picture.size()) {
    const std::string last =
        received_.known ? fmt::format("the last one here is {}", received_.number) : "there is none";
    throw Error(
        ExitCode::BadInput,
        fmt::format("encoded picture {} builds on one that is not the last one here: {}", envelope.number, last),
        "have the sender restart");
  }
  const std::size_t bits = tile_bits_size(picture.size());
  if (payload.size() < bits) throw_damaged("its list of tiles is cut short");
  const std::vector<std::size_t> tiles = read_bits(payload.first(bits), picture.size());
  const std::span<const std::byte> coded = payload.subspan(bits);
  if (!tiles.empty()) {
    Image<Rgba8> packed(packed_size(picture.size(), tiles.size()));
    coder(envelope.coder).decode(coded, envelope.error, packed);
    unpack_tiles(packed, tiles, received_.picture);
  } else if (!coded.empty()) {
    throw_damaged("it has no tiles, but bytes");
  }
  std::ranges::copy(received_.picture.pixels(), picture.pixels().begin());
}

void StreamCodec::restart() {
  sent_ = {};
  received_ = {};
}

Coder& StreamCodec::coder(std::size_t index) {
  if (!coders_[index]) coders_[index] = all_coders()[index].make(settings_);
  return *coders_[index];
}

}  // namespace hpr
