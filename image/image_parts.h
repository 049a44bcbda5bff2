#pragma once

#include <algorithm>

#include "image/image.h"

namespace hpr {

/// A copy of what stands at `place`, which lies within `image`.
template <typename Pixel>
[[nodiscard]] Image<Pixel> cut(const Image<Pixel>& image, const Rect& place) {
  Image<Pixel> part({place.width(), place.height()});
  for (int y = 0; y < part.height(); ++y) {
    std::ranges::copy_n(image.row(place.y0 + y).begin() + place.x0, part.width(), part.row(y).begin());
  }
  return part;
}

/// Copies `part` into `image`, its upper left pixel to (x, y); all of it lies within.
template <typename Pixel>
void paste(const Image<Pixel>& part, int x, int y, Image<Pixel>& image) {
  for (int row = 0; row < part.height(); ++row) std::ranges::copy(part.row(row), image.row(y + row).begin() + x);
}

}  // namespace hpr
