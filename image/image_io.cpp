#include "image/image_io.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <system_error>

#include "core/error.h"
#include "core/file.h"
#include "image/image_codec.h"

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

const ImageCodec& codec() {
  static const ImageCodec* const loaded = []() -> const ImageCodec* {
    void* const module = open_module();
    if (module == nullptr) {
      throw Error(ExitCode::Internal, fmt::format("cannot open the image module: {}", ::dlerror()),
                  "install libopenimageio2.4 and keep libhpr_imageio.so where the build or the package put it");
    }
    void* const symbol = ::dlsym(module, "hpr_image_codec");
    if (symbol == nullptr) throw Error(ExitCode::Internal, "libhpr_imageio.so has no hpr_image_codec", "reinstall hpr");
    return reinterpret_cast<decltype(&hpr_image_codec)>(symbol)();
  }();
  return *loaded;
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

Image<Rgba8> decode_image(std::span<const std::byte> bytes, const std::string& name, const ImageLimits& limits) {
  return codec().decode(bytes, name, limits);
}

FloatImage read_image(const std::filesystem::path& path, const ImageLimits& limits) {
  return codec().decode_float(read_file(path, kMaxFileBytes), path.string(), limits);
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

void write_png(const std::filesystem::path& path, const Image<Rgba8>& image) {
  write_file_atomically(path, encode_png(image));
}

}  // namespace hpr
