#pragma once

#include <cstdint>
#include <string>

#include "image/image_io.h"

namespace hpr {

/// What the module libhpr_imageio offers: the only code that sees OpenImageIO. image_io.h is its front.
class ImageCodec {
 public:
  virtual ~ImageCodec() = default;

  [[nodiscard]] virtual Image<Rgba8> decode(std::span<const std::byte> bytes, const std::string& name,
                                            const ImageLimits& limits) const = 0;
  [[nodiscard]] virtual FloatImage decode_float(std::span<const std::byte> bytes, const std::string& name,
                                                const ImageLimits& limits) const = 0;
};

}  // namespace hpr

/// The module's one symbol. The object lives as long as the module, which is never closed.
extern "C" const hpr::ImageCodec* hpr_image_codec();
