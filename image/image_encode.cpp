#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>
#include <fmt/format.h>
#include <png.h>

#include <array>
#include <cstring>
#include <exception>
#include <new>

#include "core/error.h"
#include "image/image_io.h"

// PNG and EXR are written by the formats' own libraries: a program that only writes pictures never opens OpenImageIO.
namespace hpr {
namespace {

/// A file of OpenEXR in memory.
class ExrBytes final : public Imf::OStream {
 public:
  ExrBytes() : OStream("memory") {}

  void write(const char* values, int count) override {
    const std::size_t end = position_ + static_cast<std::size_t>(count);
    if (end > bytes_.size()) bytes_.resize(end);
    std::memcpy(bytes_.data() + position_, values, static_cast<std::size_t>(count));
    position_ = end;
  }
  std::uint64_t tellp() override { return position_; }
  void seekp(std::uint64_t position) override { position_ = position; }

  [[nodiscard]] std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  std::vector<std::byte> bytes_;
  std::size_t position_ = 0;
};

/// Adds `count` channels whose four-byte values alternate in memory, pixel by pixel.
void add_channels(Imf::Header& header, Imf::FrameBuffer& pixels, std::span<const std::string> names,
                  Imf::PixelType type, const void* values, int width) {
  constexpr std::size_t kValue = 4;
  const std::size_t pixel = names.size() * kValue;
  auto* const first = static_cast<char*>(const_cast<void*>(values));  // a frame buffer for writing is only read
  for (std::size_t i = 0; i < names.size(); ++i) {
    header.channels().insert(names[i], Imf::Channel(type));
    pixels.insert(names[i], Imf::Slice(type, first + i * kValue, pixel, pixel * static_cast<std::size_t>(width)));
  }
}

}  // namespace

std::vector<std::byte> encode_png(const Image<Rgba8>& image, const PngTexts& texts) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.width());
  png.height = static_cast<png_uint_32>(image.height());
  png.format = PNG_FORMAT_RGBA;
  png.flags = PNG_IMAGE_FLAG_FAST;  // level 3 of zlib without filters: half the time of level 6 for 5 % more bytes
  std::vector<std::byte> file(PNG_IMAGE_PNG_SIZE_MAX(png));
  png_alloc_size_t size = file.size();
  if (image.pixels().empty() ||
      png_image_write_to_memory(&png, file.data(), &size, 0, image.pixels().data(), 0, nullptr) == 0) {
    throw Error(ExitCode::Io,
                fmt::format("cannot encode png: {}", image.pixels().empty() ? "no pixels" : std::string(png.message)),
                "check the picture's size");
  }
  file.resize(size);
  add_png_texts(file, texts);
  return file;
}

std::vector<std::byte> encode_exr(const Image<Rgb>& image, const std::map<std::string, std::string>& attributes,
                                  std::span<const ExrLayer> layers) {
  for (const ExrLayer& layer : layers) {
    HPR_CHECK(layer.values.empty() || layer.integers.empty());
    HPR_CHECK(layer.values.size() + layer.integers.size() == image.pixels().size() * layer.channels.size());
  }
  try {
    Imf::Header header(image.width(), image.height());
    header.compression() = Imf::ZIP_COMPRESSION;
    // The same picture is the same file, whenever it is written.
    header.insert("capDate", Imf::StringAttribute("1970:01:01 00:00:00"));
    for (const auto& [key, value] : attributes) header.insert(key, Imf::StringAttribute(value));

    Imf::FrameBuffer pixels;
    const std::array<std::string, 3> rgb{"R", "G", "B"};
    add_channels(header, pixels, rgb, Imf::FLOAT, image.pixels().data(), image.width());
    for (const ExrLayer& layer : layers) {
      const bool whole = !layer.integers.empty();
      add_channels(header, pixels, layer.channels, whole ? Imf::UINT : Imf::FLOAT,
                   whole ? static_cast<const void*>(layer.integers.data()) : layer.values.data(), image.width());
    }
    ExrBytes bytes;
    {
      Imf::OutputFile file(bytes, header, 0);
      file.setFrameBuffer(pixels);
      file.writePixels(image.height());
    }
    return bytes.take();
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    throw Error(ExitCode::Io, fmt::format("cannot encode exr: {}", error.what()), "check the picture's size");
  }
}

}  // namespace hpr
