#include "walls/codecs/jpeg.h"

#include <fmt/format.h>
#include <turbojpeg.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <new>

#include "core/error.h"
#include "walls/codecs/coder.h"

namespace hpr {
namespace {

constexpr int kMaxSide = 65500;  // libjpeg's

struct FreeTurbo {
  void operator()(void* handle) const { tjDestroy(handle); }
};
using Turbo = std::unique_ptr<void, FreeTurbo>;

Turbo made(tjhandle handle) {
  if (handle == nullptr) throw std::bad_alloc();
  return Turbo(handle);
}

/// The number of steps nearest to each difference from -255 to 255.
class StepTable {
 public:
  explicit StepTable(int error) {
    for (int difference = 0; difference < 256; ++difference) {
      const int steps = (difference + error) / (2 * error + 1);
      steps_[index(difference)] = static_cast<std::uint8_t>(steps);
      steps_[index(-difference)] = static_cast<std::uint8_t>(-steps);
    }
  }
  [[nodiscard]] std::uint8_t operator()(int difference) const { return steps_[index(difference)]; }

 private:
  [[nodiscard]] static std::size_t index(int difference) {
    const int shifted = 255 + difference;
    return static_cast<std::size_t>(shifted);
  }

  std::array<std::uint8_t, 511> steps_{};
};

std::uint8_t corrected(std::uint8_t level, std::uint8_t steps, int step) {
  return static_cast<std::uint8_t>(std::clamp(level + static_cast<std::int8_t>(steps) * step, 0, 255));
}

/// JPEG, and where an error is bounded a second part that corrects what the receiver decodes: per pixel the steps of
/// 2 error + 1 that bring r, g and b within the bound, mostly 0, and what alpha lacks, as one Zstandard frame.
class JpegCoder final : public Coder {
 public:
  explicit JpegCoder(const CodecSettings& settings) : quality_(settings.quality), error_(settings.error) {}

  [[nodiscard]] std::string_view name() const override { return "jpeg"; }

  void encode(const Image<Rgba8>& picture, std::vector<std::byte>& into, Image<Rgba8>* seen) override {
    const std::size_t start = into.size();
    if (error_ > 0) into.resize(start + sizeof(Length));
    const std::size_t first = into.size();
    encoder_.append(picture, quality_, into);
    if (error_ == 0) {
      if (seen == nullptr) return;
      *seen = Image<Rgba8>(picture.size());
      read_jpeg(std::span(into).subspan(first), *seen);
      return;
    }
    const Length length = into.size() - first;
    std::memcpy(into.data() + start, &length, sizeof(Length));
    Image<Rgba8> decoded(picture.size());
    read_jpeg(std::span(into).subspan(first), decoded);
    corrections_.resize(picture.pixels().size_bytes());
    fill_corrections(picture, decoded);
    zstd_.compress(corrections_, into);
    if (seen == nullptr) return;
    correct(decoded, error_);
    *seen = std::move(decoded);
  }

  void decode(std::span<const std::byte> bytes, int error, Image<Rgba8>& picture) override {
    if (error == 0) return read_jpeg(bytes, picture);
    Length length = 0;
    if (bytes.size() < sizeof(Length)) throw_damaged("it is cut short");
    std::memcpy(&length, bytes.data(), sizeof(Length));
    bytes = bytes.subspan(sizeof(Length));
    if (length > bytes.size()) throw_damaged("its JPEG part is cut short");
    read_jpeg(bytes.first(length), picture);
    corrections_.resize(picture.pixels().size_bytes());
    zstd_.decompress(bytes.subspan(length), corrections_);
    correct(picture, error);
  }

 private:
  using Length = std::uint64_t;

  void fill_corrections(const Image<Rgba8>& wanted, const Image<Rgba8>& decoded) {
    const std::size_t count = wanted.pixels().size();
    for (std::size_t i = 0; i < count; ++i) {
      const Rgba8 w = wanted.pixels()[i];
      const Rgba8 d = decoded.pixels()[i];
      corrections_[i] = steps_(w.r - d.r);
      corrections_[count + i] = steps_(w.g - d.g);
      corrections_[2 * count + i] = steps_(w.b - d.b);
      corrections_[3 * count + i] = static_cast<std::uint8_t>(255 - w.a);
    }
  }

  void read_jpeg(std::span<const std::byte> bytes, Image<Rgba8>& picture) {
    const auto* data = reinterpret_cast<const unsigned char*>(bytes.data());
    int width = 0;
    int height = 0;
    int subsampling = 0;
    int space = 0;
    if (tjDecompressHeader3(decompressor_.get(), data, bytes.size(), &width, &height, &subsampling, &space) != 0) {
      throw_damaged(tjGetErrorStr2(decompressor_.get()));
    }
    if (Size{width, height} != picture.size()) throw_damaged("its JPEG part is of another size");
    if (tjDecompress2(decompressor_.get(), data, bytes.size(),
                      reinterpret_cast<unsigned char*>(picture.pixels().data()), width, 0, height, TJPF_RGBA,
                      TJFLAG_ACCURATEDCT | TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS) != 0) {
      throw_damaged(tjGetErrorStr2(decompressor_.get()));
    }
  }

  void correct(Image<Rgba8>& picture, int error) const {
    const int step = 2 * error + 1;
    const std::size_t count = picture.pixels().size();
    for (std::size_t i = 0; i < count; ++i) {
      Rgba8& pixel = picture.pixels()[i];
      pixel = {corrected(pixel.r, corrections_[i], step), corrected(pixel.g, corrections_[count + i], step),
               corrected(pixel.b, corrections_[2 * count + i], step),
               static_cast<std::uint8_t>(255 - corrections_[3 * count + i])};
    }
  }

  int quality_;
  int error_;
  StepTable steps_{error_};
  JpegEncoder encoder_;
  Turbo decompressor_ = made(tjInitDecompress());
  ZstdStream zstd_;
  std::vector<std::uint8_t> corrections_;  ///< planes of r, g, b and alpha
};

}  // namespace

void JpegEncoder::Destroy::operator()(void* handle) const {
  tjDestroy(handle);
}

JpegEncoder::JpegEncoder() : compressor_(tjInitCompress()) {
  if (!compressor_) throw std::bad_alloc();
}

void JpegEncoder::append(const Image<Rgba8>& picture, int quality, std::vector<std::byte>& into) {
  HPR_CHECK(!picture.pixels().empty());
  if (std::max(picture.width(), picture.height()) > kMaxSide) {
    throw Error(ExitCode::Limit,
                fmt::format("jpeg cannot take a picture of {}x{} pixels", picture.width(), picture.height()),
                "use zstd");
  }
  const std::size_t start = into.size();
  unsigned long size = tjBufSize(picture.width(), picture.height(), TJSAMP_444);
  into.resize(start + size);
  auto* into_bytes = reinterpret_cast<unsigned char*>(into.data() + start);
  const int failed = tjCompress2(compressor_.get(), reinterpret_cast<const unsigned char*>(picture.pixels().data()),
                                 picture.width(), 0, picture.height(), TJPF_RGBX, &into_bytes, &size, TJSAMP_444,
                                 quality, TJFLAG_NOREALLOC | TJFLAG_ACCURATEDCT);
  if (failed != 0) {
    throw Error(ExitCode::Internal,
                fmt::format("libjpeg-turbo cannot compress a picture: {}", tjGetErrorStr2(compressor_.get())));
  }
  into.resize(start + size);
}

CoderKind jpeg_coder() {
  return {"jpeg", make_coder<JpegCoder>, true};
}

}  // namespace hpr
