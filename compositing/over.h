#pragma once

#include <span>
#include <type_traits>

#include "image/color.h"

namespace hpr {

/// into[i] = front[i] over back[i], channel by channel front + (1 - alpha of front) back: Porter and Duff, "Compositing
/// Digital Images", 1984. All of one length; `into` may be `front` or `back`, else all lie apart. By the widest vectors
/// this machine has; every instruction set gives the same bits.
///
/// Associative but not commutative, and that only up to rounding: docs/numerics.md has the bounds. A transparent pixel
/// changes nothing on either side, not a bit, so that leaving transparent pixels out is exact.
///
/// 8 bits: front + (x + 128 + ((x + 128) >> 8) >> 8) with x = (255 - alpha of front) back, which is x / 255 rounded to
/// nearest (no x is a tie); sums past 255, which premultiplied layers never reach, stay at 255.
void composite_over(std::span<const Rgba8Premultiplied> front, std::span<const Rgba8Premultiplied> back,
                    std::span<Rgba8Premultiplied> into);

/// Floats: three roundings, of 1 - alpha, of the product and of the sum, and no fused ones. Light past 1 is kept.
void composite_over(std::span<const RgbaPremultiplied> front, std::span<const RgbaPremultiplied> back,
                    std::span<RgbaPremultiplied> into);

/// How far blending `layers` premultiplied layers may end up from the exact result in any channel, however neighbours
/// are grouped: in levels of 8 bits, or for colours that lie in [0, 1] (for brighter ones times the least power of two
/// that no channel over alpha exceeds). Two groupings may differ by twice that. docs/numerics.md has the proof.
template <typename Pixel>
[[nodiscard]] constexpr double over_error_bound(int layers) {
  const double merges = layers - 1;
  if constexpr (std::is_same_v<Pixel, Rgba8Premultiplied>) {
    return merges;
  } else {
    constexpr double kThreeRoundings = 3 * 0x1p-24 / (1 - 3 * 0x1p-24);
    constexpr double kUnderflow = 0x1p-149;
    return merges * (2 * kThreeRoundings + kUnderflow);
  }
}

}  // namespace hpr
