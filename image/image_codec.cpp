#include "image/image_codec.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>

#include "core/error.h"

namespace hpr {
namespace {

/// The format the first bytes tell; file names and MIME types may lie.
const char* sniff(std::span<const std::byte> bytes) {
  constexpr std::array<unsigned char, 8> kPng{0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};
  constexpr std::array<unsigned char, 3> kJpeg{0xFF, 0xD8, 0xFF};
  constexpr std::array<unsigned char, 4> kExr{0x76, 0x2F, 0x31, 0x01};
  const auto starts_with = [&](const auto& magic) {
    return bytes.size() >= magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
  };
  constexpr std::array<unsigned char, 2> kRadiance{'#', '?'};
  if (starts_with(kRadiance)) return "hdr";
  return starts_with(kPng) ? "png" : starts_with(kJpeg) ? "jpeg" : starts_with(kExr) ? "openexr" : nullptr;
}

void check_limits(const OIIO::ImageSpec& spec, const std::string& name, const ImageLimits& limits) {
  if (spec.width <= 0 || spec.height <= 0 || spec.nchannels <= 0 || spec.depth > 1) {
    throw Error(ExitCode::BadInput, fmt::format("{}: a picture of {} x {} pixels", name, spec.width, spec.height),
                "repair the file");
  }
  const auto pixels = static_cast<std::uint64_t>(spec.width) * static_cast<std::uint64_t>(spec.height);
  if (spec.width > limits.side || spec.height > limits.side || pixels > limits.pixels || spec.nchannels > 64 ||
      pixels * static_cast<std::uint64_t>(spec.nchannels) > 4 * limits.pixels) {
    throw Error(ExitCode::Limit,
                fmt::format("{}: {} x {} pixels of {} channels exceed the limit of {} a side and {} in all", name,
                            spec.width, spec.height, spec.nchannels, limits.side, limits.pixels),
                "scale the picture down, or raise --limit-image");
  }
}

std::uint32_t levels_of(const OIIO::ImageSpec& spec) {
  if (spec.format == OIIO::TypeDesc::UINT8) return 0xFF;
  return spec.format == OIIO::TypeDesc::UINT16 ? 0xFFFF : 0;
}

/// An opened picture whose size was checked before a pixel is allocated.
class Input {
 public:
  Input(std::span<const std::byte> bytes, const std::string& name, const ImageLimits& limits, bool floats_allowed)
      : name_(name), memory_(const_cast<std::byte*>(bytes.data()), bytes.size()) {
    const char* const format = sniff(bytes);
    linear_ = format != nullptr && (std::strcmp(format, "openexr") == 0 || std::strcmp(format, "hdr") == 0);
    if (format == nullptr || (linear_ && !floats_allowed)) {
      throw Error(ExitCode::BadInput,
                  fmt::format("{}: not a PNG{} or JPEG picture", name, floats_allowed ? ", EXR, Radiance" : ""),
                  "convert the picture");
    }
    OIIO::ImageSpec config;
    config["oiio:UnassociatedAlpha"] = 1;
    input_ = OIIO::ImageInput::create(format, false, &config, &memory_);
    if (!input_)
      throw Error(ExitCode::Internal, fmt::format("OpenImageIO cannot read {}", format), "reinstall libopenimageio2.4");
    // open() by itself takes the file of that name: the memory must be named to it here, not only at create().
    input_->set_ioproxy(&memory_);
    OIIO::ImageSpec spec;
    if (!input_->open(name, spec, config)) fail();
    check_limits(spec, name, limits);
  }

  [[nodiscard]] const OIIO::ImageSpec& spec() const { return input_->spec(); }
  [[nodiscard]] bool linear() const { return linear_; }

  template <typename Value>
  [[nodiscard]] std::vector<Value> values(OIIO::TypeDesc type) {
    std::vector<Value> values(static_cast<std::size_t>(spec().width) * static_cast<std::size_t>(spec().height) *
                              static_cast<std::size_t>(spec().nchannels));
    if (!input_->read_image(0, 0, 0, spec().nchannels, type, values.data()) || input_->has_error()) fail();
    return values;
  }

  template <typename Value>
  [[nodiscard]] std::vector<Value> channel(int index, OIIO::TypeDesc type) {
    std::vector<Value> values(static_cast<std::size_t>(spec().width) * static_cast<std::size_t>(spec().height));
    if (!input_->read_image(0, 0, index, index + 1, type, values.data()) || input_->has_error()) fail();
    return values;
  }

 private:
  [[noreturn]] void fail() {
    throw Error(ExitCode::BadInput, fmt::format("{}: cannot decode the picture: {}", name_, input_->geterror()),
                "repair the file");
  }

  std::string name_;
  OIIO::Filesystem::IOMemReader memory_;
  std::unique_ptr<OIIO::ImageInput> input_;
  bool linear_ = false;
};

class OiioCodec final : public ImageCodec {
 public:
  OiioCodec() { OIIO::attribute("threads", 1); }

  [[nodiscard]] Image<Rgba8> decode(std::span<const std::byte> bytes, const std::string& name,
                                    const ImageLimits& limits) const override {
    Input input(bytes, name, limits, false);
    const auto values = input.values<std::uint8_t>(OIIO::TypeDesc::UINT8);
    const auto channels = static_cast<std::size_t>(input.spec().nchannels);
    Image<Rgba8> image({input.spec().width, input.spec().height});
    for (std::size_t i = 0; i < image.pixels().size(); ++i) {
      const std::uint8_t* const v = &values[i * channels];
      const bool grey = channels < 3;
      image.pixels()[i] = {v[0], grey ? v[0] : v[1], grey ? v[0] : v[2],
                           channels == 2   ? v[1]
                           : channels >= 4 ? v[3]
                                           : std::uint8_t{255}};
    }
    return image;
  }

  [[nodiscard]] FloatImage decode_float(std::span<const std::byte> bytes, const std::string& name,
                                        const ImageLimits& limits) const override {
    Input input(bytes, name, limits, true);
    const OIIO::ImageSpec& spec = input.spec();
    FloatImage image{{spec.width, spec.height},
                     spec.channelnames,
                     input.values<float>(OIIO::TypeDesc::FLOAT),
                     input.linear(),
                     levels_of(spec),
                     {}};
    for (int i = 0; i < spec.nchannels; ++i) {
      if (spec.channelformat(i) != OIIO::TypeDesc::UINT) continue;
      image.integers[spec.channel_name(i)] = input.channel<std::uint32_t>(i, OIIO::TypeDesc::UINT);
    }
    return image;
  }
};

}  // namespace
}  // namespace hpr

const hpr::ImageCodec* hpr_image_codec() {
  static const hpr::OiioCodec codec;
  return &codec;
}
