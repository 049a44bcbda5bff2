#include <fmt/format.h>
#include <zstd.h>

#include <new>

#include "core/error.h"
#include "walls/codecs/coder.h"

namespace hpr {
namespace {

constexpr int kLevel = 1;

template <typename Context>
Context* made(Context* context) {
  if (context == nullptr) throw std::bad_alloc();
  return context;
}

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

void ZstdStream::Free::operator()(void* context) const {
  ZSTD_freeCCtx(static_cast<ZSTD_CCtx*>(context));
}

void ZstdStream::FreeDecompressor::operator()(void* context) const {
  ZSTD_freeDCtx(static_cast<ZSTD_DCtx*>(context));
}

ZstdStream::ZstdStream() : compressor_(made(ZSTD_createCCtx())), decompressor_(made(ZSTD_createDCtx())) {}

void ZstdStream::compress(std::span<const std::uint8_t> bytes, std::vector<std::byte>& into) {
  const std::size_t start = into.size();
  into.resize(start + ZSTD_compressBound(bytes.size()));
  const std::size_t written = ZSTD_compressCCtx(static_cast<ZSTD_CCtx*>(compressor_.get()), into.data() + start,
                                                into.size() - start, bytes.data(), bytes.size(), kLevel);
  if (ZSTD_isError(written) != 0U) {
    throw Error(ExitCode::Internal, fmt::format("zstd cannot compress a picture: {}", ZSTD_getErrorName(written)));
  }
  into.resize(start + written);
}

void ZstdStream::decompress(std::span<const std::byte> bytes, std::span<std::uint8_t> into) {
  // One call writes straight into the result, so that a frame's own window asks for no memory. It would take several
  // frames in a row, hence the look at the first one's length.
  const std::size_t frame = ZSTD_findFrameCompressedSize(bytes.data(), bytes.size());
  if (ZSTD_isError(frame) != 0U || frame != bytes.size()) throw_damaged("it is not one Zstandard frame");
  const std::size_t read = ZSTD_decompressDCtx(static_cast<ZSTD_DCtx*>(decompressor_.get()), into.data(), into.size(),
                                               bytes.data(), bytes.size());
  if (ZSTD_isError(read) != 0U) throw_damaged(ZSTD_getErrorName(read));
  if (read != into.size()) throw_damaged("its Zstandard frame is too short");
}

CoderKind zstd_coder() {
  return {"zstd", make_coder<ZstdCoder>};
}

}  // namespace hpr
