#pragma once

#include <cstdint>

#include "image/color.h"
#include "image/image.h"

namespace hpr {

/// Draws the number of a frame into a pattern, over the one before: 16 bars, white for 1 and black for 0, the highest
/// bit at the left, and the number itself. Of two screens in one photograph the bars tell whether they show the same
/// frame.
void draw_frame_counter(Image<Rgba8>& pattern, std::uint64_t frame);

/// Bar `bit` (0 is the lowest, the rightmost) of a pattern of this size, in its pixels; empty where it is too small.
[[nodiscard]] Rect frame_counter_bar(Size pattern, int bit);

inline constexpr int kFrameCounterBits = 16;

}  // namespace hpr
