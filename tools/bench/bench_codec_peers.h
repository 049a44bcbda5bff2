#pragma once

#include <memory>
#include <string_view>

#include "image/color.h"
#include "image/image.h"

namespace hpr {

/// A library's plainest calls on a picture's pixels, as whoever has no codec of ours would write them.
class CodecPeer {
 public:
  virtual ~CodecPeer() = default;

  /// Returns the bytes it takes; kept for decode().
  virtual std::size_t encode(const Image<Rgba8>& picture) = 0;
  virtual void decode(Image<Rgba8>& picture) = 0;
};

/// The peer of a codec: a copy for raw. `quality`: of jpeg.
[[nodiscard]] std::unique_ptr<CodecPeer> make_codec_peer(std::string_view codec, int quality);

}  // namespace hpr
