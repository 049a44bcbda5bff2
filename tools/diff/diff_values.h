#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "image/image_io.h"

/// The values of two pictures against each other, whatever order their channels stand in.
namespace hpr {

/// Whether `picture` has all channels of `other` but its alpha.
[[nodiscard]] bool lacks_alpha(const FloatImage& picture, const FloatImage& other);

/// The picture with an alpha of 1.
[[nodiscard]] FloatImage opaque(const FloatImage& picture);

/// Whether both are made of levels, 8 bits of them in one and 16 in the other.
[[nodiscard]] bool differ_in_levels(const FloatImage& a, const FloatImage& b);

/// The picture, of 8 or 16 bits, with values and levels as 16 bits have them.
[[nodiscard]] FloatImage on_most_levels(const FloatImage& picture);

/// Throws Error (BadInput), naming both, unless sizes, channels and what these hold are the same.
void check_comparable(const FloatImage& a, const std::string& name_a, const FloatImage& b, const std::string& name_b);
[[noreturn]] void throw_other_kind(const std::string& a, const std::string& b);

/// image - reference (difference_of), [height][width][channels] in the order of the reference's channels, rounded once:
/// levels and integers are subtracted as such; a difference of integers is a whole number.
[[nodiscard]] std::vector<double> picture_differences(const FloatImage& image, const FloatImage& reference);

/// [pixels][3] of [pixels][channels]: the values at these places of each pixel.
[[nodiscard]] std::vector<double> only(std::span<const double> values, std::size_t channels,
                                       const std::array<std::size_t, 3>& places);

}  // namespace hpr
