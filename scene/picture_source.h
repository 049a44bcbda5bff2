#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "image/color.h"
#include "image/image.h"

namespace hpr {

/// Where the bytes of an encoded picture lie.
struct PictureSource {
  std::string name;              ///< in errors
  std::string file;              ///< its path
  std::uint64_t file_bytes = 0;  ///< of the whole file
  std::uint64_t offset = 0;      ///< in it
  std::uint64_t length = 0;
  std::uint64_t hash = 0;  ///< of the encoded bytes

  bool operator==(const PictureSource&) const = default;
};

/// The bytes that lie there now. Throws Error (Io) where the file cannot be read.
[[nodiscard]] std::vector<std::byte> read_encoded(const PictureSource& source);
/// Whether the file is there, as long as it was.
[[nodiscard]] bool is_in_reach(const PictureSource& source);

/// Decodes a picture of that size from its bytes. Throws Error (BadInput) where bytes or size are others than they
/// were.
[[nodiscard]] Image<Rgba8> decode_picture(const PictureSource& source, std::span<const std::byte> encoded, Size size);

}  // namespace hpr
