#include "walls/codecs/codec_choice.h"

#include <algorithm>

#include "core/error.h"

namespace hpr {

double seconds_per_byte(const CodecRate& rate, const CodecLink& link) {
  HPR_CHECK(link.bytes_per_second > 0.0 && link.cores > 0);
  return (rate.encode_s_per_byte + rate.decode_s_per_byte) / link.cores + rate.size / link.bytes_per_second;
}

std::string choose_codec(std::span<const CodecRate> rates, const CodecLink& link) {
  HPR_CHECK(!rates.empty());
  return std::ranges::min_element(rates, {}, [&](const CodecRate& rate) { return seconds_per_byte(rate, link); })
      ->codec;
}

}  // namespace hpr
