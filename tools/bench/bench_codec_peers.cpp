#include "tools/bench/bench_codec_peers.h"

#include <lz4.h>
#include <turbojpeg.h>
#include <zstd.h>

#include <cstring>
#include <vector>

#include "core/error.h"

namespace hpr {
namespace {

class Copy final : public CodecPeer {
 public:
  std::size_t encode(const Image<Rgba8>& picture) override {
    bytes_.resize(picture.pixels().size_bytes());
    std::memcpy(bytes_.data(), picture.pixels().data(), bytes_.size());
    return bytes_.size();
  }
  void decode(Image<Rgba8>& picture) override { std::memcpy(picture.pixels().data(), bytes_.data(), bytes_.size()); }

 private:
  std::vector<char> bytes_;
};

class BareLz4 final : public CodecPeer {
 public:
  std::size_t encode(const Image<Rgba8>& picture) override {
    const auto size = static_cast<int>(picture.pixels().size_bytes());
    bytes_.resize(static_cast<std::size_t>(LZ4_compressBound(size)));
    used_ = LZ4_compress_default(reinterpret_cast<const char*>(picture.pixels().data()), bytes_.data(), size,
                                 static_cast<int>(bytes_.size()));
    HPR_CHECK(used_ > 0);
    return static_cast<std::size_t>(used_);
  }
  void decode(Image<Rgba8>& picture) override {
    const auto size = static_cast<int>(picture.pixels().size_bytes());
    HPR_CHECK(LZ4_decompress_safe(bytes_.data(), reinterpret_cast<char*>(picture.pixels().data()), used_, size) ==
              size);
  }

 private:
  std::vector<char> bytes_;
  int used_ = 0;
};

/// At its fastest level that codes by frequency.
class BareZstd final : public CodecPeer {
 public:
  std::size_t encode(const Image<Rgba8>& picture) override {
    bytes_.resize(ZSTD_compressBound(picture.pixels().size_bytes()));
    used_ = ZSTD_compressCCtx(compressor_.get(), bytes_.data(), bytes_.size(), picture.pixels().data(),
                              picture.pixels().size_bytes(), 1);
    HPR_CHECK(ZSTD_isError(used_) == 0U);
    return used_;
  }
  void decode(Image<Rgba8>& picture) override {
    const std::size_t read = ZSTD_decompressDCtx(decompressor_.get(), picture.pixels().data(),
                                                 picture.pixels().size_bytes(), bytes_.data(), used_);
    HPR_CHECK(read == picture.pixels().size_bytes());
  }

 private:
  struct Free {
    void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
    void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
  };
  std::unique_ptr<ZSTD_CCtx, Free> compressor_{ZSTD_createCCtx()};
  std::unique_ptr<ZSTD_DCtx, Free> decompressor_{ZSTD_createDCtx()};
  std::vector<char> bytes_;
  std::size_t used_ = 0;
};

/// With the options our codec has, so that the same picture comes out.
class BareJpeg final : public CodecPeer {
 public:
  explicit BareJpeg(int quality) : quality_(quality) {}

  std::size_t encode(const Image<Rgba8>& picture) override {
    used_ = tjBufSize(picture.width(), picture.height(), TJSAMP_444);
    bytes_.resize(used_);
    unsigned char* into = bytes_.data();
    HPR_CHECK(tjCompress2(compressor_.get(), reinterpret_cast<const unsigned char*>(picture.pixels().data()),
                          picture.width(), 0, picture.height(), TJPF_RGBX, &into, &used_, TJSAMP_444, quality_,
                          TJFLAG_NOREALLOC | TJFLAG_ACCURATEDCT) == 0);
    return used_;
  }
  void decode(Image<Rgba8>& picture) override {
    HPR_CHECK(tjDecompress2(decompressor_.get(), bytes_.data(), used_,
                            reinterpret_cast<unsigned char*>(picture.pixels().data()), picture.width(), 0,
                            picture.height(), TJPF_RGBA, TJFLAG_ACCURATEDCT) == 0);
  }

 private:
  struct Free {
    void operator()(void* handle) const { tjDestroy(handle); }
  };
  int quality_;
  std::unique_ptr<void, Free> compressor_{tjInitCompress()};
  std::unique_ptr<void, Free> decompressor_{tjInitDecompress()};
  std::vector<unsigned char> bytes_;
  unsigned long used_ = 0;
};

}  // namespace

std::unique_ptr<CodecPeer> make_codec_peer(std::string_view codec, int quality) {
  if (codec == "lz4") return std::make_unique<BareLz4>();
  if (codec == "zstd") return std::make_unique<BareZstd>();
  if (codec == "jpeg") return std::make_unique<BareJpeg>(quality);
  HPR_CHECK(codec == "raw");
  return std::make_unique<Copy>();
}

}  // namespace hpr
