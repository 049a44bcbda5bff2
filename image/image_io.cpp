#include "image/image_io.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include "core/error.h"
#include "core/file.h"
#include "image/stored_picture.h"

namespace hpr {
namespace {

constexpr std::uint64_t kMaxFileBytes = std::uint64_t{4} << 30U;

/// Opens the module from lib/ beside the program's folder, where build and installation put it, else from wherever the
/// loader searches. The path comes first because a sanitizer's dlopen does not see the program's own search path.
void* open_module() {
  std::error_code error;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", error);
  const auto beside = program.parent_path().parent_path() / "lib" / "libhpr_imageio.so";
  if (!error && std::filesystem::exists(beside, error)) return ::dlopen(beside.c_str(), RTLD_LAZY | RTLD_LOCAL);
  return ::dlopen("libhpr_imageio.so", RTLD_LAZY | RTLD_LOCAL);
}

FloatImage decode_radiance(std::span<const std::byte> bytes, const std::string& name, const ImageLimits& limits) {
  static const auto decode = [] {
    void* const module = open_module();
    if (module == nullptr) {
      throw Error(ExitCode::Internal, fmt::format("cannot open the module for Radiance pictures: {}", ::dlerror()),
                  "install libopenimageio2.4 and keep libhpr_imageio.so where the build or the package put it");
    }
    void* const symbol = ::dlsym(module, "hpr_decode_radiance");
    if (symbol == nullptr) throw Error(ExitCode::Internal, "libhpr_imageio.so has no decoder", "reinstall hpr");
    return reinterpret_cast<decltype(&hpr_decode_radiance)>(symbol);
  }();
  FloatImage image;
  decode(bytes, name, limits, image);
  return image;
}

enum class Format { Png, Jpeg, WebP, Exr, Radiance };

/// The format that the first bytes tell; file names and MIME types may lie.
std::optional<Format> format_of(std::span<const std::byte> bytes) {
  using namespace std::string_view_literals;
  constexpr std::array kStarts{std::pair(Format::Png, "\x89PNG\r\n\x1A\n"sv), std::pair(Format::Jpeg, "\xFF\xD8\xFF"sv),
                               std::pair(Format::Exr, "\x76\x2F\x31\x01"sv), std::pair(Format::Radiance, "#?"sv)};
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  for (const auto& [format, start] : kStarts)
    if (text.starts_with(start)) return format;
  if (text.starts_with("RIFF"sv) && text.substr(std::min<std::size_t>(text.size(), 8)).starts_with("WEBP"sv)) {
    return Format::WebP;
  }
  return std::nullopt;
}

/// Throws Error (BadInput) for a format that HPR does not read; `read` names those it does.
[[noreturn]] void throw_unknown(std::span<const std::byte> bytes, const std::string& name, std::string_view read) {
  using namespace std::string_view_literals;
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (text.starts_with("\xABKTX 20\xBB\r\n\x1A\n"sv)) {
    throw Error(ExitCode::BadInput, fmt::format("{}: HPR reads no KTX 2 pictures", name), std::string(kKtxHint));
  }
  throw Error(ExitCode::BadInput, fmt::format("{}: not a {} picture", name, read), "convert the picture");
}

/// Of a PNG, JPEG or WebP file.
StoredPicture decode_stored(Format format, std::span<const std::byte> bytes, const std::string& name,
                            const ImageLimits& limits) {
  if (format == Format::Png) return decode_png(bytes, name, limits);
  return format == Format::Jpeg ? decode_jpeg(bytes, name, limits) : decode_webp(bytes, name, limits);
}

FloatImage to_floats(const StoredPicture& stored) {
  constexpr std::array<std::array<const char*, 4>, 4> kNames{
      {{"Y"}, {"Y", "A"}, {"R", "G", "B"}, {"R", "G", "B", "A"}}};
  const auto& names = kNames.at(stored.channels - 1);
  FloatImage image{.size = stored.size,
                   .channels = {names.begin(), names.begin() + static_cast<std::ptrdiff_t>(stored.channels)},
                   .values = std::vector<float>(stored.size.area() * stored.channels),
                   .linear = false,
                   .levels = stored.levels()};
  for (std::size_t i = 0; i < image.values.size(); ++i)
    image.values[i] = static_cast<float>(stored.level(i)) / static_cast<float>(image.levels);
  return image;
}

Image<Rgba8> to_srgb(const Image<Rgb>& image) {
  Image<Rgba8> result(image.size());
  for (std::size_t i = 0; i < image.pixels().size(); ++i) result.pixels()[i] = to_srgb(image.pixels()[i]);
  return result;
}

}  // namespace

void check_size(Size size, const ImageLimits& limits) {
  if (size.width <= limits.side && size.height <= limits.side && size.area() <= limits.pixels) return;
  throw Error(ExitCode::Limit,
              fmt::format("a picture of {}x{} pixels is beyond the limit of {} a side and {} in all", size.width,
                          size.height, limits.side, limits.pixels),
              "draw a smaller one, or raise --limit-image");
}

std::uint32_t StoredPicture::level(std::size_t index) const {
  if (!deep) return bytes[index];
  std::uint16_t value = 0;
  std::memcpy(&value, bytes.data() + 2 * index, sizeof(value));
  return value;
}

Image<Rgba8> decode_image(std::span<const std::byte> bytes, const std::string& name, const ImageLimits& limits) {
  const std::optional<Format> format = format_of(bytes);
  if (format != Format::Png && format != Format::Jpeg && format != Format::WebP) {
    throw_unknown(bytes, name, "PNG, JPEG or WebP");
  }
  const StoredPicture stored = decode_stored(*format, bytes, name, limits);
  const auto level = [&](std::size_t index) {
    const std::uint32_t value = stored.level(index);
    return static_cast<std::uint8_t>(stored.deep ? (value * 0xFF + 0x7FFF) / 0xFFFF : value);
  };
  const bool grey = stored.channels < 3;
  const bool alpha = stored.channels % 2 == 0;
  Image<Rgba8> image(stored.size);
  for (std::size_t i = 0; i < image.pixels().size(); ++i) {
    const std::size_t first = i * stored.channels;
    image.pixels()[i] = {level(first), level(grey ? first : first + 1), level(grey ? first : first + 2),
                         alpha ? level(first + stored.channels - 1) : std::uint8_t{255}};
  }
  return image;
}

FloatImage decode_float_image(std::span<const std::byte> bytes, const std::string& name, const ImageLimits& limits) {
  const std::optional<Format> format = format_of(bytes);
  if (!format) throw_unknown(bytes, name, "PNG, JPEG, WebP, EXR or Radiance");
  if (format == Format::Exr) return decode_exr(bytes, name, limits);
  if (format == Format::Radiance) return decode_radiance(bytes, name, limits);
  FloatImage image = to_floats(decode_stored(*format, bytes, name, limits));
  if (format == Format::Png) image.texts = png_texts(bytes);
  return image;
}

FloatImage read_image(const std::filesystem::path& path, const ImageLimits& limits) {
  return decode_float_image(read_file(path, kMaxFileBytes), path.string(), limits);
}

void write_image(const std::filesystem::path& path, const Image<Rgb>& image,
                 const std::map<std::string, std::string>& attributes) {
  const std::string extension = path.extension().string();
  if (extension == ".exr") {
    write_file_atomically(path, encode_exr(image, attributes));
  } else if (extension == ".png") {
    write_png(path, to_srgb(image));
  } else {
    throw Error(ExitCode::Usage,
                fmt::format("cannot write '{}': unknown picture format '{}'", path.string(), extension),
                "name a .png or .exr file");
  }
}

void write_png(const std::filesystem::path& path, const Image<Rgba8>& image, const PngTexts& texts) {
  write_file_atomically(path, encode_png(image, texts));
}

}  // namespace hpr
