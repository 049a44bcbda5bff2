#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "image/image_io.h"

namespace hpr {

/// What a PNG, JPEG or WebP file stores, before anybody says what it means.
struct StoredPicture {
  Size size;
  std::size_t channels = 0;         ///< 1: grey, 2: grey and alpha, 3: RGB, 4: RGBA
  std::vector<std::uint8_t> bytes;  ///< [height][width][channels]; of 16-bit levels two each, in the machine's order
  bool deep = false;                ///< 16 bits a level

  [[nodiscard]] std::uint32_t levels() const { return deep ? 0xFFFF : 0xFF; }
  [[nodiscard]] std::uint32_t level(std::size_t index) const;
};

/// Throws Error for what a header says: BadInput for sizes that are none, Limit beyond `limits`.
inline void check_header(std::uint64_t width, std::uint64_t height, std::uint64_t channels, const std::string& name,
                         const ImageLimits& limits) {
  if (width == 0 || height == 0 || channels == 0) {
    throw Error(ExitCode::BadInput, fmt::format("{}: a picture of {} x {} pixels", name, width, height),
                "repair the file");
  }
  const auto side = static_cast<std::uint64_t>(limits.side);
  constexpr std::uint64_t kMaxChannels = 64;
  if (width > side || height > side || width * height > limits.pixels || channels > kMaxChannels ||
      width * height * channels > 4 * limits.pixels) {
    throw Error(ExitCode::Limit,
                fmt::format("{}: {} x {} pixels of {} channels exceed the limit of {} a side and {} in all", name,
                            width, height, channels, limits.side, limits.pixels),
                "scale the picture down, or raise --limit-image");
  }
}

/// Throws Error (BadInput): the picture cannot be decoded, and why.
[[noreturn]] inline void throw_undecodable(const std::string& name, std::string_view why) {
  throw Error(ExitCode::BadInput, fmt::format("{}: cannot decode the picture: {}", name, why), "repair the file");
}

/// One decoder per format, in the file of its name. All throw Error: BadInput, or Limit before any pixel is allocated.
[[nodiscard]] StoredPicture decode_png(std::span<const std::byte> bytes, const std::string& name,
                                       const ImageLimits& limits);
[[nodiscard]] StoredPicture decode_jpeg(std::span<const std::byte> bytes, const std::string& name,
                                        const ImageLimits& limits);
[[nodiscard]] StoredPicture decode_webp(std::span<const std::byte> bytes, const std::string& name,
                                        const ImageLimits& limits);
[[nodiscard]] FloatImage decode_exr(std::span<const std::byte> bytes, const std::string& name,
                                    const ImageLimits& limits);

}  // namespace hpr

/// The one symbol of the module libhpr_imageio, the only code that sees OpenImageIO: reads a Radiance file.
extern "C" void hpr_decode_radiance(std::span<const std::byte> bytes, const std::string& name,
                                    const hpr::ImageLimits& limits, hpr::FloatImage& image);
