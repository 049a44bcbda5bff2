#pragma once

#include <cstdint>

#include "image/color.h"
#include "image/image.h"

namespace hpr {

/// A place in a picture, in 65536ths of a pixel from the middle of its upper left one to the right and down.
struct SourcePlace {
  std::uint32_t x = 0;
  std::uint32_t y = 0;

  bool operator==(const SourcePlace&) const = default;
};

/// Pixels a side that places are told of.
inline constexpr int kLargestSource = 65536;

/// Nothing of the picture: no light.
inline constexpr SourcePlace kNoSource{0xFFFFFFFFU, 0xFFFFFFFFU};

/// The place nearest to (x, y), in pixels from the picture's upper left corner; beyond the middles of the outermost
/// pixels that of these. `size` of the picture, at most kLargestSource a side.
[[nodiscard]] SourcePlace source_place(double x, double y, Size size);

/// What a picture shows at these places: bilinear between the middles of its four nearest pixels, in linear light,
/// rounded to sRGB levels; in the middle of a pixel that pixel, bit by bit. Black, and opaque, where there is none. The
/// same bits for any number of threads.
[[nodiscard]] Image<Rgba8> warped(const Image<Rgba8>& picture, const Image<SourcePlace>& sources, int threads);

}  // namespace hpr
