#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "walls/codecs/codec.h"
#include "walls/codecs/coder.h"

namespace hpr {

/// What stands before every encoded picture; little-endian.
struct Envelope {
  static constexpr std::uint8_t kTiles = 1;  ///< flag: holds only the tiles that differ from `base`
  static constexpr std::uint8_t kKeep = 2;   ///< flag: a later picture may build on this one

  std::uint32_t magic = 0x43525048;  ///< "HPRC"
  std::uint8_t version = 1;
  std::uint8_t coder = 0;  ///< index into all_coders()
  std::uint8_t flags = 0;
  std::uint8_t error = 0;  ///< of the encoder's settings
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint64_t number = 0;         ///< of the picture in its stream, from 1
  std::uint64_t base = 0;           ///< with kTiles: the checksum of the picture this one builds on
  std::uint64_t payload_bytes = 0;  ///< what follows
  std::uint64_t checksum = 0;       ///< xxh64 of all above and of the payload

  [[nodiscard]] bool has(std::uint8_t flag) const { return (flags & flag) != 0; }
};
static_assert(sizeof(Envelope) == 48);

/// `bytes` begins with room for an envelope; the rest is the payload. Fills in size and checksum of `envelope` and
/// writes it there.
void seal(Envelope& envelope, std::vector<std::byte>& bytes);

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
  void decode_tiles(const Envelope& envelope, std::span<const std::byte> payload, Image<Rgba8>& picture);
  [[nodiscard]] Coder& coder(std::size_t index);

  std::size_t own_;
  CodecSettings settings_;
  std::vector<std::unique_ptr<Coder>> coders_;  ///< by their numbers; made when first needed
  std::uint64_t encoded_ = 0;
  Base sent_;  ///< its picture: with a bound what the receiver sees, else what was to be sent
  Base received_;
};

}  // namespace hpr
