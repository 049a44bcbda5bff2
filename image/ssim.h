#pragma once

#include <span>

#include "image/image.h"

namespace hpr {

/// Structural similarity (Wang, Bovik, Sheikh, Simoncelli, "Image Quality Assessment: From Error Visibility to
/// Structural Similarity", 2004): 1 for equal pictures, less the more they differ, symmetric. Gaussian window of 11 x
/// 11 pixels, standard deviation 1.5, K1 = 0.01, K2 = 0.03; the mean over the channels and over all windows that lie
/// whole in the picture. A picture narrower or lower than the window is mirrored at its borders instead, and every
/// pixel is the centre of a window.
///
/// Both [height][width][3] display values in [0, 1]. NaN where a value is not finite; 1 without pixels. The same bits
/// for any number of threads.
[[nodiscard]] double ssim(std::span<const float> image, std::span<const float> reference, Size size, int threads);

}  // namespace hpr
