#pragma once

#include "image/color.h"
#include "image/image.h"

/// Test pictures with a known right answer, sRGB, the same to the bit on every machine.
namespace hpr::patterns {

/// Intensity 0.5 + 0.5 cos(2 pi r^2 / (2 width)), r in texels from the centre: reaches the sampling limit of half a
/// cycle a texel at the left and right edge.
[[nodiscard]] Image<Rgba8> zone_plate(Size size);

/// Black lines one texel wide at every multiple of `step` texels, on white.
[[nodiscard]] Image<Rgba8> texel_grid(Size size, int step);

/// 2 * lines sectors, black and white in turn, about the centre. `lines` is even, so that the star is symmetric.
[[nodiscard]] Image<Rgba8> siemens_star(Size size, int lines);

/// `steps` equal bars from black to white, even in sRGB levels.
[[nodiscard]] Image<Rgba8> grey_wedge(Size size, int steps);

/// Says of each texel where it is: red grows with x, green with y, and every cell of 32 x 32 texels bears its column
/// (upper row) and line (lower row) as five squares of binary digits, most significant first. A shifted, doubled or
/// missing tile shows.
[[nodiscard]] Image<Rgba8> tile_ruler(Size size);

/// Two squares a side: `odd` at the upper left and lower right.
[[nodiscard]] Image<Rgba8> checker(Rgb odd, Rgb even);

}  // namespace hpr::patterns
