#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "walls/codecs/codec.h"

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

/// Sends the first pictures of a stream by each codec in turn, all of them twice, then all others by the one that
/// would have brought those soonest over the link.
class AutoCodec final : public Codec {
 public:
  explicit AutoCodec(const CodecSettings& settings);

  [[nodiscard]] std::string_view name() const override { return "auto"; }
  [[nodiscard]] std::vector<std::byte> encode(const Image<Rgba8>& picture) override;
  void decode(std::span<const std::byte> bytes, Image<Rgba8>& picture) override;
  void restart() override;

  /// The codec that was chosen; empty while it still tries.
  [[nodiscard]] std::string_view choice() const { return choice_; }

 private:
  [[nodiscard]] std::vector<std::byte> try_next(const Image<Rgba8>& picture);

  CodecSettings settings_;
  std::vector<std::unique_ptr<Codec>> codecs_;
  std::vector<CodecRate> rates_;  ///< of codecs_: the least seconds of any try
  std::size_t tries_ = 0;
  std::string choice_;
  Codec* chosen_ = nullptr;
};

}  // namespace hpr
