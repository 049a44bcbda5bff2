#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "image/color.h"
#include "image/image.h"
#include "image/png_texts.h"

namespace hpr {

/// How large a picture may be before it is refused (ExitCode::Limit).
struct ImageLimits {
  int side = 16384;
  std::uint64_t pixels = std::uint64_t{1} << 27;  ///< 128 Mi
};

/// The hint for pictures of GPU formats (KTX 2 with Basis Universal), which no library of Debian 12 reads.
inline constexpr std::string_view kKtxHint =
    "convert it: npx @gltf-transform/cli ktxdecompress IN.glb OUT.glb (a scene), or ktx extract IN.ktx2 OUT.png";

/// The default limits of pictures that HPR itself draws or reads back.
inline constexpr ImageLimits kPictureLimits{.side = 1 << 20, .pixels = std::uint64_t{1} << 31};

/// Throws Error (Limit) for a picture or screen beyond `limits`.
void check_size(Size size, const ImageLimits& limits);

/// A picture read from a file: `values` [height][width][channels], linear for EXR and Radiance (.hdr), the stored level
/// / 255 for PNG, JPEG and WebP.
struct FloatImage {
  Size size;
  std::vector<std::string> channels;
  std::vector<float> values;
  bool linear = false;       ///< radiance, not display values
  std::uint32_t levels = 0;  ///< values are whole multiples of 1 / levels; 0: any numbers
  /// Channels stored as unsigned integers, [height][width], bit by bit; `values` has them as fractions of 2^32 - 1.
  std::map<std::string, std::vector<std::uint32_t>> integers = {};
  PngTexts texts = {};  ///< of a PNG
};

/// One more channel set of an EXR file, e.g. depth or surface ids; floats survive bit by bit.
struct ExrLayer {
  std::vector<std::string> channels;         ///< e.g. {"normal.X", "normal.Y", "normal.Z"}
  std::vector<float> values;                 ///< [height][width][channels]
  std::vector<std::uint32_t> integers = {};  ///< instead of `values`: the channels are unsigned integers
};

/// PNG, 8 bit RGBA, sRGB.
[[nodiscard]] std::vector<std::byte> encode_png(const Image<Rgba8>& image, const PngTexts& texts = {});

/// EXR, 32-bit float R G B (bit-exact, NaN included) and `layers` in one part; `attributes` go into the header.
[[nodiscard]] std::vector<std::byte> encode_exr(const Image<Rgb>& image,
                                                const std::map<std::string, std::string>& attributes,
                                                std::span<const ExrLayer> layers = {});

/// Decodes PNG, JPEG or WebP without animation (known by their first bytes). Alpha is 255 where the file has none; grey
/// becomes r = g = b; 16-bit values are rounded to 8. `name` stands in errors. Throws Error: BadInput, or Limit before
/// any pixel is allocated.
[[nodiscard]] Image<Rgba8> decode_image(std::span<const std::byte> bytes, const std::string& name,
                                        const ImageLimits& limits);

/// Decodes PNG, JPEG, WebP, EXR or Radiance (.hdr). `name` stands in errors. Throws Error: BadInput, or Limit before
/// any pixel is allocated.
[[nodiscard]] FloatImage decode_float_image(std::span<const std::byte> bytes, const std::string& name,
                                            const ImageLimits& limits);
/// Reads such a file. Throws Error (Io, BadInput, Limit).
[[nodiscard]] FloatImage read_image(const std::filesystem::path& path, const ImageLimits& limits);

/// Writes `image` atomically as PNG (through to_srgb) or EXR, by the extension of `path`; throws Error (Usage) for
/// others.
void write_image(const std::filesystem::path& path, const Image<Rgb>& image,
                 const std::map<std::string, std::string>& attributes = {});
void write_png(const std::filesystem::path& path, const Image<Rgba8>& image, const PngTexts& texts = {});

}  // namespace hpr
