#pragma once

#include <span>

#include "image/image.h"

namespace hpr {

/// Pixels per degree of a screen 0.7 m wide with 3840 pixels a row, seen from 0.7 m.
inline constexpr double kFlipPixelsPerDegree = 67.0206432765823;

/// What a viewer sees who flips between two pictures.
struct FlipError {
  double mean = 0.0;  ///< over the pixels of `map`
  Image<float> map;   ///< from 0, not seen, to 1; empty where `mean` is NaN
};

/// LDR-FLIP (Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild, "FLIP: A Difference Evaluator for
/// Alternating Images", 2020): how far colours are apart after the eye's blur, raised where edges or points differ.
/// Symmetric; 0 for equal pictures. Beyond their borders pictures go on as they are there.
///
/// Both [height][width][3] display values in [0, 1]. The mean is NaN where a value is not finite and 0 without pixels.
/// Any number of threads gives the same bits.
[[nodiscard]] FlipError flip_error(std::span<const float> image, std::span<const float> reference, Size size,
                                   int threads, double pixels_per_degree = kFlipPixelsPerDegree);

}  // namespace hpr
