#include "walls/codecs/coder.h"
#include "walls/codecs/pixel_planes.h"
#include "walls/codecs/zstd_stream.h"

namespace hpr {
namespace {

/// Filtered planes as one Zstandard frame.
class ZstdCoder final : public Coder {
 public:
  explicit ZstdCoder(const CodecSettings& settings) : error_(settings.error) {}

  [[nodiscard]] std::string_view name() const override { return "zstd"; }

  void encode(const Image<Rgba8>& picture, std::vector<std::byte>& into, Image<Rgba8>* seen) override {
    planes_.resize(picture.pixels().size_bytes());
    if (error_ == 0) {
      split_planes(picture.pixels(), planes_);
    } else {
      steps_.resize(picture.pixels().size());
      quantize(picture.pixels(), error_, steps_);
      split_planes(steps_, planes_);
    }
    zstd_.compress(planes_, into);
    if (seen == nullptr) return;
    *seen = picture;
    if (error_ > 0) dequantize(steps_, error_, seen->pixels());
  }

  void decode(std::span<const std::byte> bytes, int error, Image<Rgba8>& picture) override {
    planes_.resize(picture.pixels().size_bytes());
    zstd_.decompress(bytes, planes_);
    join_planes(planes_, picture.pixels());
    if (error > 0) dequantize(picture.pixels(), error, picture.pixels());
  }

 private:
  int error_;
  ZstdStream zstd_;
  std::vector<std::uint8_t> planes_;
  std::vector<Rgba8> steps_;
};

}  // namespace

CoderKind zstd_coder() {
  return {"zstd", make_coder<ZstdCoder>};
}

}  // namespace hpr
