#pragma once

#include <span>

#include "walls/codecs/codec.h"
#include "walls/codecs/coder.h"
#include "walls/codecs/envelope.h"

namespace hpr {

/// One coder's pictures in envelopes, whole or as the tiles that changed.
class StreamCodec final : public Codec {
 public:
  /// `coder`: index into all_coders().
  StreamCodec(std::size_t coder, const CodecSettings& settings);

  [[nodiscard]] std::string_view name() const override;
  [[nodiscard]] std::vector<std::byte> encode(const Image<Rgba8>& picture) override;
  void decode(std::span<const std::byte> bytes, Image<Rgba8>& picture) override;
  void restart() override;

 private:
  /// What the next picture may build on.
  struct Base {
    std::uint64_t checksum = 0;  ///< of the message that brought it
    std::uint64_t number = 0;
    Image<Rgba8> picture;
    bool known = false;
  };

  void encode_whole(const Image<Rgba8>& picture, std::vector<std::byte>& bytes);
  void encode_tiles(const Image<Rgba8>& picture, std::span<const std::size_t> tiles, std::vector<std::byte>& bytes);
  void decode_tiles(const Opened& opened, Image<Rgba8>& picture);
  [[nodiscard]] Coder& coder(std::size_t index);

  std::size_t own_;
  CodecSettings settings_;
  std::vector<std::unique_ptr<Coder>> coders_;  ///< by their numbers; made when first needed
  std::uint64_t encoded_ = 0;
  Base sent_;  ///< its picture: with a bound what the receiver sees, else what was to be sent
  Base received_;
};

}  // namespace hpr
