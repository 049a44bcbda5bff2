#include "walls/codecs/jpeg_encoder.h"

#include <fmt/format.h>
#include <turbojpeg.h>

#include <algorithm>
#include <new>

#include "core/error.h"

namespace hpr {
namespace {

constexpr int kLargestSide = 65500;  // libjpeg's

}  // namespace

void JpegEncoder::Destroy::operator()(void* handle) const {
  tjDestroy(handle);
}

JpegEncoder::JpegEncoder() : compressor_(tjInitCompress()) {
  if (!compressor_) throw std::bad_alloc();
}

void JpegEncoder::append(const Image<Rgba8>& picture, int quality, std::vector<std::byte>& into) {
  HPR_CHECK(!picture.pixels().empty());
  if (std::max(picture.width(), picture.height()) > kLargestSide) {
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

}  // namespace hpr
