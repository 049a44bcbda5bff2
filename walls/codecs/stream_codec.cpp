#include "walls/codecs/stream_codec.h"

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
  std::vector<std::byte> bytes;
  bytes.reserve(sizeof(Envelope) + picture.pixels().size_bytes());
  bytes.resize(sizeof(Envelope));
  if (!picture.pixels().empty()) coder(own_).encode(picture, bytes, nullptr);
  seal(envelope, bytes);
  return bytes;
}

void StreamCodec::decode(std::span<const std::byte> bytes, Image<Rgba8>& picture) {
  const Opened opened = open_envelope(bytes, picture.size());
  if (opened.envelope.flags != 0) throw_damaged("its flags are unknown");
  if (!picture.pixels().empty()) coder(opened.envelope.coder).decode(opened.body, opened.envelope.error, picture);
}

void StreamCodec::restart() {}

Coder& StreamCodec::coder(std::size_t index) {
  if (!coders_[index]) coders_[index] = all_coders()[index].make(settings_);
  return *coders_[index];
}

}  // namespace hpr
