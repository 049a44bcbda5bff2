#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfVersion.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <exception>
#include <stdexcept>
#include <string_view>

#include "core/error.h"
#include "image/stored_picture.h"

namespace hpr {
namespace {

/// A file of OpenEXR in memory. OpenEXR catches what its streams throw, as std::exception.
class ExrInput final : public Imf::IStream {
 public:
  ExrInput(std::span<const std::byte> bytes, const std::string& name) : IStream(name.c_str()), bytes_(bytes) {}

  bool read(char* into, int count) override {
    const auto wanted = static_cast<std::size_t>(std::max(count, 0));
    if (position_ > bytes_.size() || wanted > bytes_.size() - position_) {
      throw std::runtime_error("the file ends too early");
    }
    std::memcpy(into, bytes_.data() + position_, wanted);
    position_ += wanted;
    return position_ < bytes_.size();
  }
  std::uint64_t tellg() override { return position_; }
  void seekg(std::uint64_t position) override { position_ = position; }

 private:
  std::span<const std::byte> bytes_;
  std::size_t position_ = 0;
};

/// Whether every attribute of the first part's header lies in the file: OpenEXR makes room for one before it reads it.
bool has_whole_header(std::span<const std::byte> bytes) {
  constexpr std::size_t kVersion = 8;  // of the file, with the magic number
  std::string_view left(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  left.remove_prefix(std::min(kVersion, left.size()));
  const auto skip_text = [&] {
    const std::size_t end = left.find('\0');
    const bool found = end != std::string_view::npos;
    left.remove_prefix(found ? end + 1 : left.size());
    return found;
  };
  while (!left.empty() && left.front() != '\0') {
    std::int32_t size = 0;
    const bool named = skip_text();
    const bool typed = skip_text();
    if (!named || !typed || left.size() < sizeof(size)) return false;
    std::memcpy(&size, left.data(), sizeof(size));
    left.remove_prefix(sizeof(size));
    if (size < 0 || static_cast<std::size_t>(size) > left.size()) return false;
    left.remove_prefix(static_cast<std::size_t>(size));
  }
  return !left.empty();
}

/// The first part's header, read without what OpenEXR allocates for pixels.
Imf::Header read_header(ExrInput& file) {
  std::array<char, 8> start{};
  (void)file.read(start.data(), start.size());
  std::int32_t version = 0;
  std::memcpy(&version, start.data() + 4, sizeof(version));
  Imf::Header header;
  header.readFrom(file, version);
  file.seekg(0);
  return header;
}

struct ExrChannel {
  std::string name;
  Imf::PixelType type = Imf::FLOAT;
};

/// Layer by layer, those without a layer first; in each colour, alpha and depth as one expects them, then the rest by
/// name. A file has them by name.
std::vector<ExrChannel> ordered_channels(const Imf::Header& header) {
  const auto order = [](const ExrChannel& channel) {
    constexpr std::array<std::string_view, 5> kFirst{"R", "G", "B", "A", "Z"};
    const std::size_t dot = channel.name.rfind('.');
    const std::string layer = dot == std::string::npos ? "" : channel.name.substr(0, dot);
    const std::string name = channel.name.substr(dot == std::string::npos ? 0 : dot + 1);
    return std::tuple(layer, std::ranges::find(kFirst, name) - kFirst.begin(), name);
  };
  std::vector<ExrChannel> channels;
  for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel) {
    if (channel.channel().xSampling != 1 || channel.channel().ySampling != 1)
      throw std::runtime_error(fmt::format("channel {} has fewer samples than pixels", channel.name()));
    channels.push_back({channel.name(), channel.channel().type});
  }
  std::ranges::sort(channels, {}, order);
  return channels;
}

/// Reads all channels into an image whose sizes are set.
void read_pixels(Imf::InputFile& file, const std::vector<ExrChannel>& channels, FloatImage& image) {
  const IMATH_NAMESPACE::Box2i window = file.header().dataWindow();
  const auto width = static_cast<std::size_t>(image.size.width);
  Imf::FrameBuffer pixels;
  const auto add = [&](const ExrChannel& channel, Imf::PixelType type, void* first, std::size_t stride) {
    // The buffer's origin is pixel (0, 0), wherever the data begins.
    auto* const base = static_cast<char*>(first);
    const auto offset =
        static_cast<std::ptrdiff_t>(stride) * (window.min.x + window.min.y * static_cast<std::ptrdiff_t>(width));
    pixels.insert(channel.name, Imf::Slice(type, base - offset, stride, stride * width));
  };
  for (std::size_t i = 0; i < channels.size(); ++i) {
    if (channels[i].type == Imf::UINT) {
      std::vector<std::uint32_t>& integers = image.integers[channels[i].name];
      integers.resize(image.size.area());
      add(channels[i], Imf::UINT, integers.data(), sizeof(std::uint32_t));
    } else {
      add(channels[i], Imf::FLOAT, image.values.data() + i, channels.size() * sizeof(float));
    }
  }
  file.setFrameBuffer(pixels);
  file.readPixels(window.min.y, window.max.y);
  for (std::size_t i = 0; i < channels.size(); ++i) {
    if (channels[i].type != Imf::UINT) continue;
    constexpr double kMax = 0xFFFFFFFF;
    const std::vector<std::uint32_t>& integers = image.integers.at(channels[i].name);
    for (std::size_t pixel = 0; pixel < integers.size(); ++pixel)
      image.values[pixel * channels.size() + i] = static_cast<float>(integers[pixel] / kMax);
  }
}

}  // namespace

FloatImage decode_exr(std::span<const std::byte> bytes, const std::string& name, const ImageLimits& limits) {
  if (!has_whole_header(bytes)) throw_undecodable(name, "the header is cut short");
  try {
    ExrInput input(bytes, name);
    const Imf::Header header = read_header(input);
    const IMATH_NAMESPACE::Box2i& window = header.dataWindow();
    const std::vector<ExrChannel> channels = ordered_channels(header);
    const std::int64_t width = std::int64_t{window.max.x} - window.min.x + 1;
    const std::int64_t height = std::int64_t{window.max.y} - window.min.y + 1;
    check_header(static_cast<std::uint64_t>(std::max(width, std::int64_t{0})),
                 static_cast<std::uint64_t>(std::max(height, std::int64_t{0})), channels.size(), name, limits);
    FloatImage image{
        .size = {static_cast<int>(width), static_cast<int>(height)}, .channels = {}, .values = {}, .linear = true};
    Imf::InputFile file(input, 0);
    image.values.resize(image.size.area() * channels.size());
    for (const ExrChannel& channel : channels) image.channels.push_back(channel.name);
    read_pixels(file, channels, image);
    return image;
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw_undecodable(name, error.what());
  }
}

}  // namespace hpr
