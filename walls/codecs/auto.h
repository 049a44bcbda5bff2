#pragma once

#include <string>
#include <vector>

#include "walls/codecs/codec.h"
#include "walls/codecs/codec_choice.h"

namespace hpr {

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
