#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace hpr {

/// What a codec did to pictures of this run, on one core each.
struct CodecRate {
  std::string codec;
  double encode_s_per_byte = 0.0;  ///< seconds per byte of pixels
  double decode_s_per_byte = 0.0;
  double size = 1.0;  ///< encoded bytes per byte of pixels
};

struct CodecLink {
  double bytes_per_second = 0.0;  ///< shared by all streams
  int cores = 1;                  ///< how many streams are encoded, and decoded, at a time
};

/// Seconds from finished pixels to the last pixel decoded, per byte of pixels of all streams together.
[[nodiscard]] double seconds_per_byte(const CodecRate& rate, const CodecLink& link);

/// The codec with the fewest seconds; the first of equals. `rates` is not empty.
[[nodiscard]] std::string choose_codec(std::span<const CodecRate> rates, const CodecLink& link);

}  // namespace hpr
