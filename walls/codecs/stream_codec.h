#pragma once

#include <array>

#include "walls/codec.h"
#include "walls/codecs/coder.h"
#include "walls/codecs/envelope.h"

namespace hpr {

/// One coder's pictures in envelopes.
class StreamCodec final : public Codec {
 public:
  /// `coder`: index into all_coders().
  StreamCodec(std::size_t coder, const CodecSettings& settings);

  [[nodiscard]] std::string_view name() const override;
  [[nodiscard]] std::vector<std::byte> encode(const Image<Rgba8>& picture) override;
  void decode(std::span<const std::byte> bytes, Image<Rgba8>& picture) override;
  void restart() override;

 private:
  [[nodiscard]] Coder& coder(std::size_t index);

  std::size_t own_;
  CodecSettings settings_;
  std::vector<std::unique_ptr<Coder>> coders_;  ///< by their numbers; made when first needed
  std::uint64_t encoded_ = 0;
};

}  // namespace hpr
