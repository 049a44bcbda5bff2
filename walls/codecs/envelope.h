#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "image/image.h"

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
  std::uint64_t number = 0;      ///< of the picture in its stream, from 1
  std::uint64_t base = 0;        ///< with kTiles: the checksum of the picture this one builds on
  std::uint64_t body_bytes = 0;  ///< what follows
  std::uint64_t checksum = 0;    ///< xxh64 of all above and of the body

  [[nodiscard]] bool has(std::uint8_t flag) const { return (flags & flag) != 0; }
};
static_assert(sizeof(Envelope) == 48);

/// `bytes` begins with room for an envelope; the rest is the body. Fills in size and checksum of `envelope` and writes
/// it there.
void seal(Envelope& envelope, std::vector<std::byte>& bytes);

struct Opened {
  Envelope envelope;
  std::span<const std::byte> body;
};

/// Throws Error (BadInput) unless every bit is as it was sealed and the picture is of `size`.
[[nodiscard]] Opened open_envelope(std::span<const std::byte> bytes, Size size);

}  // namespace hpr
