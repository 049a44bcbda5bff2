#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "image/color.h"
#include "image/image.h"

namespace hpr {

/// JPEG by libjpeg-turbo, colours at full resolution: halved ones bleed over the borders of tiles sent side by side.
class JpegEncoder {
 public:
  JpegEncoder();

  /// Appends `picture`, which is not empty, without its alpha; `quality` 1 to 100. Throws Error (Limit) for more than
  /// 65500 pixels a side.
  void append(const Image<Rgba8>& picture, int quality, std::vector<std::byte>& into);

 private:
  struct Destroy {
    void operator()(void* handle) const;
  };
  std::unique_ptr<void, Destroy> compressor_;
};

}  // namespace hpr
