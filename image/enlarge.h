#pragma once

#include "image/color.h"
#include "image/image.h"

namespace hpr {

/// `image` on `size` pixels, neither empty: bilinear in linear light, so that every new pixel is a mean of the four
/// pixels whose centres lie about its own, and of the nearest ones beyond the centres of the outermost. An even picture
/// stays as it is, nothing gets brighter than the brightest pixel. The bits depend on the picture and the size alone.
[[nodiscard]] Image<Rgb> enlarge(const Image<Rgb>& image, Size size, int threads);

}  // namespace hpr
