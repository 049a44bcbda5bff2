#include "scene/picture_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "core/bytes.h"
#include "core/error.h"
#include "core/text.h"
#include "image/image_io.h"

namespace hpr {
namespace {

void check_bytes(const PictureSource& source, std::span<const std::byte> encoded) {
  if (encoded.size() == source.length && xxh64(encoded) == source.hash) return;
  throw Error(ExitCode::BadInput, fmt::format("{}: the picture changed while the scene was used", source.name),
              "leave the scene's files alone, and have the same ones on every host");
}

}  // namespace

bool is_in_reach(const PictureSource& source) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(source.file, error);
  return !error && size == source.file_bytes && std::ifstream(source.file, std::ios::binary).good();
}

std::vector<std::byte> read_encoded(const PictureSource& source) {
  std::vector<std::byte> bytes(source.length);
  std::ifstream file(source.file, std::ios::binary);
  file.seekg(static_cast<std::streamoff>(source.offset));
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!file) {
    throw Error(ExitCode::Io, fmt::format("{}: cannot read '{}'", source.name, printable(source.file)),
                "leave the scene's files alone while it is used");
  }
  return bytes;
}

Image<Rgba8> decode_picture(const PictureSource& source, std::span<const std::byte> encoded, Size size) {
  check_bytes(source, encoded);
  Image<Rgba8> decoded =
      decode_image(encoded, source.name, {.side = std::max(size.width, size.height), .pixels = size.area()});
  if (decoded.size() != size) {
    throw Error(ExitCode::BadInput, fmt::format("{}: the picture has another size on this host", source.name),
                "run the same build of hpr on every host");
  }
  return decoded;
}

}  // namespace hpr
