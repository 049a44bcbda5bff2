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
#include <new>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>

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

/// Reads the heads of attributes as they lie in a file.
class AttributeReader {
 public:
  explicit AttributeReader(std::string_view left) : left_(left) {}

  [[nodiscard]] std::size_t left() const { return left_.size(); }
  /// Up to the next 0, which goes too; none where there is none.
  std::optional<std::string_view> text() {
    const std::size_t end = left_.find('\0');
    if (end == std::string_view::npos) return std::nullopt;
    const std::string_view found = left_.substr(0, end);
    left_.remove_prefix(end + 1);
    return found;
  }
  std::optional<std::uint32_t> number() {
    std::uint32_t value = 0;
    const auto bytes = take(sizeof(value));
    if (!bytes) return std::nullopt;
    std::memcpy(&value, bytes->data(), sizeof(value));
    return value;
  }
  std::optional<std::string_view> take(std::size_t count) {
    if (count > left_.size()) return std::nullopt;
    const std::string_view part = left_.substr(0, count);
    left_.remove_prefix(count);
    return part;
  }

 private:
  std::string_view left_;
};

/// Whether the list of channels ends where its attribute does.
bool is_whole_channel_list(AttributeReader value) {
  constexpr std::size_t kChannel = 16;  // bytes after the name
  while (const auto name = value.text()) {
    if (name->empty()) return value.left() == 0;
    if (!value.take(kChannel)) return false;
  }
  return false;
}

bool is_whole_string_list(AttributeReader value) {
  while (value.left() > 0) {
    const auto length = value.number();
    if (!length || !value.take(*length)) return false;
  }
  return true;
}

bool is_whole_preview(AttributeReader value) {
  const auto width = value.number();
  const auto height = value.number();
  constexpr std::uint64_t kMaxSide = 1U << 16U;
  return width && height && *width <= kMaxSide && *height <= kMaxSide &&
         value.left() == std::uint64_t{4} * *width * *height;
}

/// Whether OpenEXR will take as many bytes for the value of an attribute as the file says it has. It goes by the type
/// and makes room for lengths it finds on the way, where the two differ gigabytes of them.
bool is_whole_value(std::string_view type, std::string_view value) {
  constexpr std::array<std::pair<std::string_view, std::size_t>, 25> kSizes{{{"box2i", 16},
                                                                             {"box2f", 16},
                                                                             {"chromaticities", 32},
                                                                             {"compression", 1},
                                                                             {"deepImageState", 1},
                                                                             {"double", 8},
                                                                             {"envmap", 1},
                                                                             {"float", 4},
                                                                             {"int", 4},
                                                                             {"keycode", 28},
                                                                             {"lineOrder", 1},
                                                                             {"m33f", 36},
                                                                             {"m33d", 72},
                                                                             {"m44f", 64},
                                                                             {"m44d", 128},
                                                                             {"rational", 8},
                                                                             {"tiledesc", 9},
                                                                             {"timecode", 8},
                                                                             {"v2i", 8},
                                                                             {"v2f", 8},
                                                                             {"v2d", 16},
                                                                             {"v3i", 12},
                                                                             {"v3f", 12},
                                                                             {"v3d", 24},
                                                                             {"half", 2}}};
  const auto fixed = std::ranges::find(kSizes, type, &std::pair<std::string_view, std::size_t>::first);
  if (fixed != kSizes.end()) return value.size() == fixed->second;
  if (type == "chlist") return is_whole_channel_list(AttributeReader(value));
  if (type == "stringvector") return is_whole_string_list(AttributeReader(value));
  if (type == "preview") return is_whole_preview(AttributeReader(value));
  if (type == "floatvector") return value.size() % 4 == 0;
  return true;  // texts, and what OpenEXR does not know, are as long as they say
}

/// The attributes of one header, up to the 0 behind the last.
bool is_whole_header(AttributeReader& file) {
  while (const auto name = file.text()) {
    if (name->empty()) return true;
    const auto type = file.text();
    const auto size = type ? file.number() : std::nullopt;
    const auto value = size ? file.take(*size) : std::nullopt;
    if (!value || !is_whole_value(*type, *value)) return false;
  }
  return false;
}

/// Whether every attribute of the file's headers lies in the file and has the length of its type.
bool has_whole_headers(std::span<const std::byte> bytes) {
  constexpr std::uint32_t kManyParts = 0x1000;  // then headers follow each other, an empty one last
  AttributeReader file({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  const auto magic = file.number();
  const auto version = file.number();
  if (!magic || !version || !is_whole_header(file)) return false;
  if ((*version & kManyParts) == 0) return true;
  for (std::size_t before = file.left(); is_whole_header(file); before = file.left())
    if (before - file.left() == 1) return true;
  return false;
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
  if (!has_whole_headers(bytes)) throw_undecodable(name, "its header does not hold together");
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
  } catch (const std::bad_alloc&) {
    throw Error(ExitCode::Limit, fmt::format("{}: out of memory", name), "use a smaller picture");
  } catch (const std::exception& error) {
    throw_undecodable(name, error.what());
  }
}

}  // namespace hpr
