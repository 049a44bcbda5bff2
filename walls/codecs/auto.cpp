#include "walls/codecs/auto.h"

#include <algorithm>
#include <limits>

#include "core/error.h"
#include "core/log.h"
#include "core/timing.h"
#include "walls/codecs/coder.h"

namespace hpr {
namespace {

constexpr std::size_t kTriesEach = 2;  // the first one also pays for fresh memory

}  // namespace

double seconds_per_byte(const CodecRate& rate, const CodecLink& link) {
  HPR_CHECK(link.bytes_per_second > 0.0 && link.cores > 0);
  return (rate.encode_s_per_byte + rate.decode_s_per_byte) / link.cores + rate.size / link.bytes_per_second;
}

std::string choose_codec(std::span<const CodecRate> rates, const CodecLink& link) {
  HPR_CHECK(!rates.empty());
  return std::ranges::min_element(rates, {}, [&](const CodecRate& rate) { return seconds_per_byte(rate, link); })
      ->codec;
}

AutoCodec::AutoCodec(const CodecSettings& settings) : settings_(settings) {
  for (const CoderKind& kind : all_coders()) {
    if (settings.error == 0 && kind.lossy) continue;
    codecs_.push_back(make_codec(kind.name, settings));
    const double unknown = std::numeric_limits<double>::infinity();
    rates_.push_back({std::string(kind.name), unknown, unknown, unknown});
  }
}

std::vector<std::byte> AutoCodec::encode(const Image<Rgba8>& picture) {
  if (chosen_ == nullptr && !picture.pixels().empty()) return try_next(picture);
  return (chosen_ != nullptr ? chosen_ : codecs_.front().get())->encode(picture);
}

std::vector<std::byte> AutoCodec::try_next(const Image<Rgba8>& picture) {
  const std::size_t turn = tries_++ % codecs_.size();
  Codec& codec = *codecs_[turn];
  codec.restart();  // whole pictures measure best, and what the receiver saw last came by another codec
  const auto pixel_bytes = static_cast<double>(picture.pixels().size_bytes());
  const Stopwatch encoding;
  std::vector<std::byte> bytes = codec.encode(picture);
  const double encode_ms = encoding.ms();
  Image<Rgba8> arrived(picture.size());
  const auto receiver = make_codec(rates_[turn].codec, {});
  const Stopwatch decoding;
  receiver->decode(bytes, arrived);
  const double decode_ms = decoding.ms();
  CodecRate& rate = rates_[turn];
  rate.encode_s_per_byte = std::min(rate.encode_s_per_byte, encode_ms / 1e3 / pixel_bytes);
  rate.decode_s_per_byte = std::min(rate.decode_s_per_byte, decode_ms / 1e3 / pixel_bytes);
  rate.size = std::min(rate.size, static_cast<double>(bytes.size()) / pixel_bytes);
  if (tries_ == kTriesEach * codecs_.size()) {
    choice_ = choose_codec(rates_, {settings_.link_bytes_per_second, settings_.cores});
    chosen_ = std::ranges::find(codecs_, choice_, [](const auto& each) { return each->name(); })->get();
    // The receiver has seen the last codec's picture last.
    if (chosen_ != &codec) chosen_->restart();
    log::debug("codec: {} for a link of {:.0f} MB/s", choice_, settings_.link_bytes_per_second / 1e6);
  }
  return bytes;
}

void AutoCodec::decode(std::span<const std::byte> bytes, Image<Rgba8>& picture) {
  codecs_.front()->decode(bytes, picture);
}

void AutoCodec::restart() {
  for (const auto& codec : codecs_) codec->restart();
}

}  // namespace hpr
