#include "walls/codecs/stream_codec.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/error.h"
#include "walls/codecs/changed_tiles.h"

namespace hpr {

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
    decode_tiles(opened, picture);
  } else if (!picture.pixels().empty()) {
    coder(envelope.coder).decode(opened.body, envelope.error, picture);
  } else if (!opened.body.empty()) {
    throw_damaged("it has no pixels, but bytes");
  }
  received_.known = envelope.has(Envelope::kKeep);
  if (received_.known && !envelope.has(Envelope::kTiles)) received_.picture = picture;
  received_.checksum = envelope.checksum;
  received_.number = envelope.number;
}

void StreamCodec::decode_tiles(const Opened& opened, Image<Rgba8>& picture) {
  const Envelope& envelope = opened.envelope;
  if (!received_.known || received_.checksum != envelope.base || received_.picture.size() != picture.size()) {
    const std::string last =
        received_.known ? fmt::format("the last one here is {}", received_.number) : "there is none";
    throw Error(
        ExitCode::BadInput,
        fmt::format("encoded picture {} builds on one that is not the last one here: {}", envelope.number, last),
        "have the sender restart");
  }
  const std::size_t bits = tile_bits_size(picture.size());
  if (opened.body.size() < bits) throw_damaged("its list of tiles is cut short");
  const std::vector<std::size_t> tiles = read_bits(opened.body.first(bits), picture.size());
  const std::span<const std::byte> coded = opened.body.subspan(bits);
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
